//! Checks that the settings of all lasers have in common.

use runtime::OpenError;

/// Longest name of a model.
const NAME: usize = 24;

/// Whether `model` can be a name; `such_as` are some.
pub fn check_model(model: &str, such_as: &str) -> Result<(), OpenError> {
    if model.is_empty() || model.len() > NAME || !model.is_ascii() {
        let text = format!("model \"{model}\" is no name of a laser; write auto, or such as {such_as}");
        return Err(OpenError::config(text));
    }
    Ok(())
}

/// What the laser's name must begin with: nothing where any will do.
pub fn wanted_model(model: &str) -> String {
    if model.eq_ignore_ascii_case("auto") { String::new() } else { model.to_owned() }
}

/// Whether the laser knows all `bauds` [baud].
pub fn check_bauds<'a>(mut bauds: impl Iterator<Item = &'a u32>, known: &[u32]) -> Result<(), OpenError> {
    match bauds.find(|baud| !known.contains(baud)) {
        Some(baud) => Err(OpenError::config(format!("{baud} is no rate of this laser; known: {known:?}"))),
        None => Ok(()),
    }
}

/// Whether a figure lies within its bounds.
pub fn check_bounds(name: &str, value: f64, least: f64, most: f64) -> Result<(), OpenError> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(OpenError::config(format!("{name} = {value} is out of bounds: {least} to {most}")))
}
