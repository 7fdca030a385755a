//! A small SVG writer with compact output.

use std::fmt::Write;

use super::units::escape;

/// Horizontal alignment of a text relative to its position.
#[derive(Clone, Copy, Debug)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// An SVG document under construction.
#[derive(Debug)]
pub(super) struct Svg {
    document: String,
    width: f64,
}

// Writing to a String cannot fail, so the results of `write!` are ignored.
impl Svg {
    /// Starts a document. `label` describes the picture for screen readers.
    pub(super) fn new(width: f64, height: f64, label: &str) -> Self {
        let (w, h, label) = (number(width), number(height), escape(label));
        let document = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" role=\"img\" \
             aria-label=\"{label}\" font-family=\"system-ui, -apple-system, 'Segoe UI', 'Helvetica Neue', Arial, sans-serif\">\n\
             <rect width=\"{w}\" height=\"{h}\" fill=\"#fff\"/>\n"
        );
        Self { document, width }
    }

    /// Opens a group whose members share these attributes; [`close`](Self::close) ends it.
    pub(super) fn open(&mut self, attributes: &str) {
        let _ = writeln!(self.document, "<g {attributes}>");
    }

    /// Ends the group that was opened last.
    pub(super) fn close(&mut self) {
        self.document.push_str("</g>\n");
    }

    /// Writes a line through points; a polygon if `closed`.
    pub(super) fn path(&mut self, points: &[[f64; 2]], closed: bool, attributes: &str) {
        let place = |[x, y]: [f64; 2]| format!("{} {}", number(x), number(y));
        let places: Vec<String> = points.iter().copied().map(place).collect();
        let end = if closed { "z" } else { "" };
        let space = if attributes.is_empty() { "" } else { " " };
        let _ = writeln!(self.document, "<path d=\"M{}{end}\"{space}{attributes}/>", places.join("L"));
    }

    /// Writes many separate lines as one path.
    pub(super) fn segments(&mut self, segments: &[[[f64; 2]; 2]], attributes: &str) {
        if segments.is_empty() {
            return;
        }
        let mut data = String::with_capacity(24 * segments.len());
        for [[ax, ay], [bx, by]] in segments {
            let _ = write!(data, "M{} {}L{} {}", number(*ax), number(*ay), number(*bx), number(*by));
        }
        self.data(&data, attributes);
    }

    /// Writes a path from its data.
    pub(super) fn data(&mut self, data: &str, attributes: &str) {
        let _ = writeln!(self.document, "<path d=\"{data}\" {attributes}/>");
    }

    /// Draws filled circles of one radius.
    pub(super) fn circles(&mut self, centers: &[[f64; 2]], radius: f64, attributes: &str) {
        self.open(attributes);
        for &[x, y] in centers {
            let _ = writeln!(self.document, "<circle cx=\"{}\" cy=\"{}\" r=\"{radius}\"/>", number(x), number(y));
        }
        self.close();
    }

    /// Draws a rectangle (left, top, width, height).
    pub(super) fn rectangle(&mut self, [x, y, width, height]: [f64; 4], attributes: &str) {
        let (x, y, width, height) = (number(x), number(y), number(width), number(height));
        let _ =
            writeln!(self.document, "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" {attributes}/>");
    }

    /// Defines a gradient from left to right through equally spaced colors; fills refer to it by its name.
    pub(super) fn gradient(&mut self, name: &str, colors: impl ExactSizeIterator<Item = [u8; 3]>) {
        let last = colors.len().saturating_sub(1).max(1);
        let _ = write!(self.document, "<linearGradient id=\"{name}\">");
        for (k, color) in colors.enumerate() {
            let place = number(100.0 * k as f64 / last as f64);
            let _ = write!(self.document, "<stop offset=\"{place}%\" stop-color=\"{}\"/>", hex(color));
        }
        self.document.push_str("</linearGradient>\n");
    }

    /// Defines a gradient with the colors of another one, between two points of the page.
    pub(super) fn gradient_like(&mut self, name: &str, colors: &str, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2]) {
        let [x1, y1, x2, y2] = [x1, y1, x2, y2].map(number);
        let _ = writeln!(
            self.document,
            "<linearGradient id=\"{name}\" xlink:href=\"#{colors}\" gradientUnits=\"userSpaceOnUse\" x1=\"{x1}\" \
             y1=\"{y1}\" x2=\"{x2}\" y2=\"{y2}\"/>"
        );
    }

    /// Writes a line of text with its baseline at the given position.
    pub(super) fn text(&mut self, [x, y]: [f64; 2], size: f64, anchor: Anchor, attributes: &str, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        };
        let (x, y, size, text) = (number(x), number(y), number(size), escape(text));
        let _ = writeln!(
            self.document,
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\"{anchor} {attributes}>{text}</text>"
        );
    }

    /// Writes a line of text that starts at `x`, shortened so that it ends at least `x` before the right edge.
    pub(super) fn title(&mut self, [x, y]: [f64; 2], size: f64, attributes: &str, text: &str) {
        let most = ((self.width - 2.0 * x) / text_width("n", size)).max(1.0) as usize;
        if text.chars().count() <= most {
            return self.text([x, y], size, Anchor::Start, attributes, text);
        }
        let kept: String = text.chars().take(most - 1).collect();
        self.text([x, y], size, Anchor::Start, attributes, &format!("{}\u{2026}", kept.trim_end()));
    }

    /// Ends the document and returns its text.
    pub(super) fn finish(mut self) -> String {
        self.document.push_str("</svg>\n");
        self.document
    }
}

/// Returns an upper estimate of the width of a text: 0.6 of the font size per letter, more than the mean of any
/// sans-serif font.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    0.6 * size * text.chars().count() as f64
}

/// Formats a color for SVG, in the short notation if that is exact.
pub(super) fn hex([r, g, b]: [u8; 3]) -> String {
    if [r, g, b].iter().all(|part| part % 17 == 0) {
        format!("#{:x}{:x}{:x}", r / 17, g / 17, b / 17)
    } else {
        format!("#{r:02x}{g:02x}{b:02x}")
    }
}

/// Formats a coordinate with one decimal: a tenth of a pixel is enough.
fn number(value: f64) -> String {
    let text = format!("{value:.1}");
    let text = text.strip_suffix(".0").unwrap_or(&text);
    if text == "-0" { "0".into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_colors_are_short() {
        assert_eq!([number(12.04), number(-0.01), number(3.26)], ["12", "0", "3.3"]);
        assert_eq!([hex([255, 0, 17]), hex([254, 0, 17])], ["#f01", "#fe0011"]);
    }

    #[test]
    fn a_title_longer_than_the_picture_is_shortened() {
        let mut svg = Svg::new(100.0, 10.0, "");
        svg.title([10.0, 5.0], 10.0, "", "thirteen<char");
        svg.title([10.0, 9.0], 10.0, "", "fourteen chars");
        let text = svg.finish();
        assert!(text.contains(">thirteen&lt;char</text>") && text.contains(">fourteen cha\u{2026}</text>"), "{text}");
    }

    #[test]
    fn labels_and_text_are_escaped() {
        let mut svg = Svg::new(10.0, 10.0, "\"><script>");
        svg.text([0.0, 0.0], 9.0, Anchor::End, "", "a<b");
        let text = svg.finish();
        assert!(!text.contains("<script") && text.contains("a&lt;b"));
    }
}
