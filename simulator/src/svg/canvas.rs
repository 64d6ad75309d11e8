//! SVG text, element by element.

use crate::geometry::Point;
use std::fmt::Write;

/// Styles, so that the elements stay short and a person can restyle a picture in one place.
const STYLE: &str = "
text{font-family:'Helvetica Neue',Helvetica,Arial,'DejaVu Sans',sans-serif;font-size:12px;fill:#333a44}
.title{font-size:17px;font-weight:600}.small{font-size:11px;fill:#6b7280}.value{font-weight:600;text-anchor:end}
.floor{fill:#fff;stroke:#d8d4ca}.solid{fill:#c9c4b8}.wall{stroke:#3b424d;stroke-width:1.6;stroke-linecap:round;fill:none}
.post{fill:#c9c4b8;stroke:#3b424d;stroke-width:1.2}.grid{stroke:#ece9e1;stroke-width:1}
.way{fill:none;stroke:#8c6bb1;stroke-width:1.4;stroke-dasharray:5 5;opacity:.75}.person{fill:#8c6bb1;fill-opacity:.85;stroke:#fff}
.trace{fill:none;stroke:#8c6bb1;stroke-width:1.5;opacity:.6;stroke-linejoin:round}.begun{fill:#fff;stroke:#8c6bb1;stroke-width:1.4}
.track{fill:none;stroke-width:2.2;stroke-linejoin:round;stroke-linecap:round}.start{fill:#fff;stroke:#1b7f5c;stroke-width:2.4}
.robot{fill:#e4572e;fill-opacity:.92;stroke:#7a2412;stroke-width:1.2;stroke-linejoin:round}.nose{fill:#fff;stroke:none}
.beam{fill:#2e86de;fill-opacity:.13;stroke:#2e86de;stroke-opacity:.35;stroke-width:.6}.silent{fill:#2e86de;fill-opacity:.04}
.caused{stroke:#d00000;stroke-width:2.6;stroke-linecap:round;fill:none}.suffered{stroke:#e07a00;stroke-width:2.2;fill:none}
.panel{fill:#fff;stroke:#d8d4ca}.calm{fill:#7fb3a2;fill-opacity:.85;stroke:#4d8573}.strong{fill:#e4572e;fill-opacity:.85;stroke:#a33a1c}
.ring{fill:none;stroke:#a33a1c;stroke-width:1.4;stroke-dasharray:4 3}.bar{stroke:#333a44;stroke-width:1.6;fill:none}
.rule{stroke:#ece9e1}
";

/// Where the world lies on the map.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    /// World's point at the lower left corner.
    pub low: Point,
    /// Pixels per metre.
    pub scale: f64,
    /// Height of the map [px].
    pub height_px: f64,
}

impl View {
    /// A point of the world on the map: y grows downwards there.
    pub fn at(&self, point: Point) -> (f64, f64) {
        ((point.x_m - self.low.x_m) * self.scale, self.height_px - (point.y_m - self.low.y_m) * self.scale)
    }
}

/// An SVG file in the making.
pub(super) struct Canvas {
    text: String,
}

impl Canvas {
    pub fn new(width: f64, height: f64) -> Canvas {
        let mut text = String::with_capacity(1 << 16);
        let (width, height) = (width.ceil(), height.ceil());
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\">\n\
             <style>{STYLE}</style>\n<rect width=\"{width}\" height=\"{height}\" fill=\"#faf9f6\"/>\n"
        );
        Canvas { text }
    }

    pub fn finish(mut self) -> String {
        self.text.push_str("</svg>\n");
        self.text
    }

    pub fn open_group(&mut self, at: (f64, f64)) {
        let _ = writeln!(self.text, "<g transform=\"translate({:.1} {:.1})\">", at.0, at.1);
    }

    pub fn close_group(&mut self) {
        self.text.push_str("</g>\n");
    }

    pub fn rect(&mut self, at: (f64, f64), size: (f64, f64), class: &str) {
        let _ = writeln!(
            self.text,
            "<rect class=\"{class}\" x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\"/>",
            at.0, at.1, size.0, size.1
        );
    }

    pub fn line(&mut self, from: (f64, f64), to: (f64, f64), class: &str) {
        let _ = writeln!(
            self.text,
            "<line class=\"{class}\" x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\"/>",
            from.0, from.1, to.0, to.1
        );
    }

    pub fn circle(&mut self, at: (f64, f64), radius: f64, class: &str) {
        let _ =
            writeln!(self.text, "<circle class=\"{class}\" cx=\"{:.1}\" cy=\"{:.1}\" r=\"{radius:.1}\"/>", at.0, at.1);
    }

    pub fn polygon(&mut self, points: impl Iterator<Item = (f64, f64)>, class: &str) {
        self.points("polygon", points, class, "");
    }

    /// `colour` overrides the class's stroke; empty for none.
    pub fn polyline(&mut self, points: impl Iterator<Item = (f64, f64)>, class: &str, colour: &str) {
        self.points("polyline", points, class, colour);
    }

    pub fn text(&mut self, at: (f64, f64), class: &str, words: &str) {
        let _ = write!(self.text, "<text class=\"{class}\" x=\"{:.1}\" y=\"{:.1}\">", at.0, at.1);
        for letter in words.chars() {
            match letter {
                '<' => self.text.push_str("&lt;"),
                '>' => self.text.push_str("&gt;"),
                '&' => self.text.push_str("&amp;"),
                _ => self.text.push(letter),
            }
        }
        self.text.push_str("</text>\n");
    }

    /// A bar of `steps` colours side by side.
    pub fn colour_bar(&mut self, at: (f64, f64), size: (f64, f64), colours: impl ExactSizeIterator<Item = String>) {
        let step = size.0 / colours.len() as f64;
        for (k, colour) in colours.enumerate() {
            let _ = writeln!(
                self.text,
                "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"{colour}\"/>",
                at.0 + k as f64 * step,
                at.1,
                // A hair of overlap leaves no seams between neighbours.
                step + 0.3,
                size.1
            );
        }
    }

    fn points(&mut self, element: &str, points: impl Iterator<Item = (f64, f64)>, class: &str, colour: &str) {
        let _ = write!(self.text, "<{element} class=\"{class}\"");
        if !colour.is_empty() {
            let _ = write!(self.text, " stroke=\"{colour}\"");
        }
        self.text.push_str(" points=\"");
        for (k, (x, y)) in points.enumerate() {
            let _ = write!(self.text, "{}{x:.1},{y:.1}", if k > 0 { " " } else { "" });
        }
        self.text.push_str("\"/>\n");
    }
}
