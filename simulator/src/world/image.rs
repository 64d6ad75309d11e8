//! Grey pictures for maps: PGM (plain and raw) and PNG.

use super::error::WorldError;

/// Pixels a map may have at most: a guard against a wrong size in a header.
const MAX_PIXELS: usize = 100_000_000;
const PNG_MAGIC: &[u8] = b"\x89PNG";

/// A grey picture, rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Image {
    pub width: usize,
    pub height: usize,
    /// Brightness 0…255 (mean of the colours), `None` where transparent.
    pub shades: Vec<Option<f32>>,
}

/// Reads a PGM or PNG picture.
pub(super) fn decode(file: &str, bytes: &[u8]) -> Result<Image, WorldError> {
    match bytes {
        [b'P', b'2' | b'5', ..] => pgm(file, bytes),
        _ if bytes.starts_with(PNG_MAGIC) => png(file, bytes),
        _ => Err(WorldError::of_file(file, "it is neither PGM (P2, P5) nor PNG", "convert the picture to one of them")),
    }
}

fn pgm(file: &str, bytes: &[u8]) -> Result<Image, WorldError> {
    let fault = |reason: &str| WorldError::of_file(file, reason, "write the picture again as PGM");
    let plain = bytes[1] == b'2';
    let mut rest = &bytes[2..];
    let number = |rest: &mut &[u8]| -> Result<usize, WorldError> {
        skip_blank(rest);
        let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
        let (text, after) = rest.split_at(digits);
        *rest = after;
        std::str::from_utf8(text)
            .ok()
            .and_then(|text| text.parse().ok())
            .ok_or_else(|| fault("its PGM header or data lack a number"))
    };
    let (width, height, most) = (number(&mut rest)?, number(&mut rest)?, number(&mut rest)?);
    let pixels = width.checked_mul(height).filter(|pixels| (1..=MAX_PIXELS).contains(pixels));
    let pixels = pixels.ok_or_else(|| fault("its PGM size is zero or too large"))?;
    if !(1..=65535).contains(&most) {
        return Err(fault("its PGM maximum must lie within 1 and 65535"));
    }
    let scale = 255.0 / most as f32;
    let shade = |value: usize| Some(value.min(most) as f32 * scale);
    let shades = if plain {
        (0..pixels).map(|_| number(&mut rest).map(shade)).collect::<Result<Vec<_>, _>>()?
    } else {
        // One blank byte ends the header; values above 255 take two bytes, high byte first.
        let data = rest.get(1..).unwrap_or_default();
        let wide = most > 255;
        let needed = if wide { 2 * pixels } else { pixels };
        let data = data.get(..needed).ok_or_else(|| fault("its PGM data end early"))?;
        if wide {
            data.chunks_exact(2).map(|pair| shade(usize::from(pair[0]) << 8 | usize::from(pair[1]))).collect()
        } else {
            data.iter().map(|byte| shade(usize::from(*byte))).collect()
        }
    };
    Ok(Image { width, height, shades })
}

/// Skips white space and comments.
fn skip_blank(rest: &mut &[u8]) {
    loop {
        let blank = rest.iter().take_while(|byte| byte.is_ascii_whitespace()).count();
        *rest = &rest[blank..];
        if rest.first() != Some(&b'#') {
            return;
        }
        let comment = rest.iter().take_while(|byte| **byte != b'\n').count();
        *rest = &rest[comment..];
    }
}

fn png(file: &str, bytes: &[u8]) -> Result<Image, WorldError> {
    let fault = |reason: String| WorldError::of_file(file, reason, "write the picture again as PNG");
    let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::STRIP_16);
    let mut reader = decoder.read_info().map_err(|error| fault(format!("its PNG header is wrong ({error})")))?;
    let size = reader.output_buffer_size().filter(|size| *size <= 4 * MAX_PIXELS);
    let size = size.ok_or_else(|| fault("its PNG size is too large".to_owned()))?;
    let mut data = vec![0; size];
    let info = reader.next_frame(&mut data).map_err(|error| fault(format!("its PNG data are wrong ({error})")))?;
    let channels = info.color_type.samples();
    let transparent = matches!(info.color_type, png::ColorType::GrayscaleAlpha | png::ColorType::Rgba);
    let colours = if transparent { channels - 1 } else { channels };
    let shade = |pixel: &[u8]| {
        let sum: u32 = pixel[..colours].iter().map(|colour| u32::from(*colour)).sum();
        (!transparent || pixel[colours] > 0).then_some(sum as f32 / colours as f32)
    };
    let shades = data[..info.buffer_size()].chunks_exact(channels).map(shade).collect();
    Ok(Image { width: info.width as usize, height: info.height as usize, shades })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encoded(color: png::ColorType, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 2, 1);
        encoder.set_color(color);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.write_header().unwrap().write_image_data(data).unwrap();
        bytes
    }

    #[test]
    fn plain_and_raw_pgm_say_the_same() {
        let plain = decode("a.pgm", b"P2 # a comment\n2 2 # size\n100\n0 50\n100 25").unwrap();
        assert_eq!(plain, decode("a.pgm", b"P5\n2 2\n100\n\x00\x32\x64\x19").unwrap());
        assert_eq!(plain.shades[2], Some(255.0));
        let wide = decode("a.pgm", b"P5 1 1 1000\n\x01\xF4").unwrap();
        assert_eq!(wide.shades, [Some(127.5)]);
    }

    #[test]
    fn png_colours_are_averaged_and_transparent_pixels_unknown() {
        let grey = decode("a.png", &encoded(png::ColorType::Grayscale, &[0, 200])).unwrap();
        assert_eq!(grey.shades, [Some(0.0), Some(200.0)]);
        let colour = decode("a.png", &encoded(png::ColorType::Rgba, &[30, 60, 90, 255, 1, 2, 3, 0])).unwrap();
        assert_eq!(colour.shades, [Some(60.0), None]);
    }

    #[test]
    fn broken_pictures_are_refused_with_a_reason() {
        for (bytes, reason) in [
            (&b"P5\n2 2\n255\n\x00"[..], "end early"),
            (b"P5\n0 2\n255\n", "size is zero"),
            (b"P2\n2 2\n255\n1 2 x", "lack a number"),
            (b"P2\n99999999 99999999\n255\n", "too large"),
            (b"GIF89a", "neither PGM"),
            (b"\x89PNG\r\n\x1a\nrubbish", "PNG header"),
        ] {
            let said = decode("m.img", bytes).unwrap_err().to_string();
            assert!(said.starts_with("m.img: ") && said.contains(reason), "{said}");
        }
    }
}
