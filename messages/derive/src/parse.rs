//! Reads the struct that derives `Message`, and refuses what cannot be shared.

use proc_macro2::{Span, TokenStream};
use quote::quote;
use syn::ext::IdentExt;
use syn::spanned::Spanned;
use syn::{Attribute, Data, DeriveInput, Error, Expr, Fields, Ident, Lit, LitStr, Meta, Path, Result, Type};

/// A struct that may become a message.
pub struct Message {
    pub ident: Ident,
    pub name: String,
    pub doc: String,
    pub fields: Vec<Field>,
    pub tail: Option<Type>,
    /// Path of the crate `messages` as the struct's crate sees it.
    pub krate: TokenStream,
}

/// One named field.
pub struct Field {
    pub ident: Ident,
    pub name: String,
    pub ty: Type,
    pub doc: String,
    pub unit: Option<String>,
    pub values: Vec<String>,
}

impl Message {
    pub fn read(input: DeriveInput) -> Result<Message> {
        let span = input.ident.span();
        let fields = match input.data {
            Data::Struct(data) => match data.fields {
                Fields::Named(fields) => fields.named,
                _ => return Err(Error::new(span, "a message's fields need names, with their units: `range_m: f32`")),
            },
            Data::Enum(_) => {
                let why = "an enum cannot be shared: another process may write any bits; use a u32 field with \
                           `#[message(values = \"first second\")]`";
                return Err(Error::new(span, why));
            }
            Data::Union(_) => {
                return Err(Error::new(span, "a union cannot be shared: nothing says which field is valid"));
            }
        };
        if !input.generics.params.is_empty() {
            let why = "a message cannot be generic: its layout is one, known to every program";
            return Err(Error::new(input.generics.params.span(), why));
        }
        check_repr(&input.attrs, span)?;
        let name = ascii_name(&input.ident)?;
        let (doc, _) = split_unit(&first_paragraph(&input.attrs));
        let mut message =
            Message { ident: input.ident, name, doc, fields: Vec::new(), tail: None, krate: quote!(::messages) };
        message.read_options(&input.attrs)?;
        for field in fields {
            let field = Field::read(field)?;
            if message.tail.is_some() && field.name == "tail" {
                return Err(Error::new(field.ident.span(), "the name `tail` is taken by `#[message(tail = …)]`"));
            }
            message.fields.push(field);
        }
        Ok(message)
    }

    fn read_options(&mut self, attrs: &[Attribute]) -> Result<()> {
        for attr in attrs.iter().filter(|attr| attr.path().is_ident("message")) {
            attr.parse_nested_meta(|option| {
                if option.path.is_ident("tail") {
                    self.tail = Some(option.value()?.parse()?);
                } else if option.path.is_ident("crate") {
                    let path: Path = option.value()?.call(Path::parse_mod_style)?;
                    self.krate = quote!(#path);
                } else {
                    return Err(option.error("known here: `tail = Type`, `crate = path::to::messages`"));
                }
                Ok(())
            })?;
        }
        Ok(())
    }
}

impl Field {
    fn read(field: syn::Field) -> Result<Field> {
        let ident = field.ident.ok_or_else(|| Error::new(Span::call_site(), "a message's fields need names"))?;
        let name = ascii_name(&ident)?;
        let (doc, mut unit) = split_unit(&first_paragraph(&field.attrs));
        let mut values = Vec::new();
        for attr in field.attrs.iter().filter(|attr| attr.path().is_ident("message")) {
            attr.parse_nested_meta(|option| {
                if option.path.is_ident("unit") {
                    unit = Some(checked_unit(&option.value()?.parse()?)?);
                } else if option.path.is_ident("values") {
                    values = checked_values(&option.value()?.parse()?, &field.ty)?;
                } else {
                    return Err(option.error("known here: `unit = \"m/s\"`, `values = \"first second\"`"));
                }
                Ok(())
            })?;
        }
        Ok(Field { ident, name, ty: field.ty, doc, unit, values })
    }
}

/// `repr(C)`, and nothing that changes it but a lower alignment limit that the layout check sees.
fn check_repr(attrs: &[Attribute], span: Span) -> Result<()> {
    let mut is_c = false;
    for attr in attrs.iter().filter(|attr| attr.path().is_ident("repr")) {
        attr.parse_nested_meta(|option| {
            if option.path.is_ident("C") {
                is_c = true;
            } else if option.path.is_ident("align") {
                let content;
                syn::parenthesized!(content in option.input);
                content.parse::<Lit>()?;
            } else {
                return Err(option.error("a message is `repr(C)`: order its fields so that no padding is needed"));
            }
            Ok(())
        })?;
    }
    if is_c {
        Ok(())
    } else {
        Err(Error::new(span, "a message needs `#[repr(C)]`: Rust may reorder the fields otherwise"))
    }
}

/// The name without `r#`.
fn ascii_name(ident: &Ident) -> Result<String> {
    let name = ident.unraw().to_string();
    if name.is_ascii() {
        Ok(name)
    } else {
        Err(Error::new(ident.span(), "names in messages are ASCII: other languages read them"))
    }
}

fn checked_unit(unit: &LitStr) -> Result<String> {
    let text = unit.value();
    if text.is_empty() || text.len() > 128 || text.chars().any(char::is_control) {
        return Err(Error::new(unit.span(), "a unit is 1 to 128 bytes on one line, for example \"m/s\""));
    }
    Ok(text)
}

fn checked_values(list: &LitStr, ty: &Type) -> Result<Vec<String>> {
    let Some(most) = most_values(ty) else {
        return Err(Error::new(ty.span(), "only u8, u16, u32 and u64 fields and arrays of them can have named values"));
    };
    let text = list.value();
    let mut values: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        if !word.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_') || word.len() > 128 {
            return Err(Error::new(
                list.span(),
                format!("`{word}` is no name of a value: use a-z, 0-9 and _, at most 128"),
            ));
        }
        if values.iter().any(|value| value == word) {
            return Err(Error::new(list.span(), format!("`{word}` is there twice")));
        }
        values.push(word.to_owned());
    }
    if values.is_empty() || values.len() > most {
        return Err(Error::new(
            list.span(),
            format!("give 1 to {most} names, separated by spaces: the values 0, 1, 2…"),
        ));
    }
    Ok(values)
}

/// How many values of this type can have names; `None` where it is no unsigned integer.
fn most_values(ty: &Type) -> Option<usize> {
    match ty {
        Type::Array(array) => most_values(&array.elem),
        Type::Path(path) => match path.path.segments.last()?.ident.to_string().as_str() {
            "u8" => Some(256),
            "u16" | "u32" | "u64" => Some(4096),
            _ => None,
        },
        _ => None,
    }
}

/// The first paragraph of the doc comment, on one line.
fn first_paragraph(attrs: &[Attribute]) -> String {
    let mut paragraph = String::new();
    for attr in attrs.iter().filter(|attr| attr.path().is_ident("doc")) {
        let Meta::NameValue(pair) = &attr.meta else { continue };
        let Expr::Lit(literal) = &pair.value else { continue };
        let Lit::Str(text) = &literal.lit else { continue };
        // Not `lines`: an empty `///` must count as a line. Block comments carry a star in front of each.
        for line in text.value().split('\n') {
            let line = line.trim().trim_start_matches('*').trim();
            match (line.is_empty(), paragraph.is_empty()) {
                (true, true) => {}
                (true, false) => return paragraph,
                (false, true) => paragraph.push_str(line),
                (false, false) => {
                    paragraph.push(' ');
                    paragraph.push_str(line);
                }
            }
        }
    }
    paragraph
}

/// Takes the unit off the end: `"Distance [m]."` is `("Distance.", Some("m"))`. Links, which have backquotes, are no units.
fn split_unit(paragraph: &str) -> (String, Option<String>) {
    let text = paragraph.strip_suffix('.').unwrap_or(paragraph);
    let unit = text.strip_suffix(']').and_then(|text| text.rsplit_once('['));
    match unit {
        Some((doc, unit)) if !unit.is_empty() && !unit.contains(['`', ']']) && unit.len() <= 128 => {
            let doc = doc.trim_end();
            let stop = if doc.is_empty() || doc.ends_with('.') { "" } else { "." };
            (format!("{doc}{stop}"), Some(unit.to_owned()))
        }
        _ => (paragraph.to_owned(), None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_is_in_brackets_at_the_end() {
        assert_eq!(split_unit("Distance [m]."), ("Distance.".to_owned(), Some("m".to_owned())));
        assert_eq!(split_unit("Speed [m/s]"), ("Speed.".to_owned(), Some("m/s".to_owned())));
        assert_eq!(split_unit("The link; see [`Link`]."), ("The link; see [`Link`].".to_owned(), None));
        assert_eq!(split_unit("In [0, 1] always."), ("In [0, 1] always.".to_owned(), None));
    }
}
