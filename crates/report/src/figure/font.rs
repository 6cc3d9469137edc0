//! The embedded font of the figures, DejaVu Sans: text widths do not depend on the machine.
//!
//! DejaVu Sans contains subscripts as in `a₁`, Greek letters and mathematical signs. An SVG
//! viewer without it uses the next font of [`FAMILY`], Verdana, which has the same proportions.

use skrifa::instance::{LocationRef, Size};
use skrifa::{FontRef, MetadataProvider};

/// Font family list of an SVG, in order of preference.
pub(crate) const FAMILY: &str = "DejaVu Sans, Verdana, Helvetica, Arial, sans-serif";

/// Weight of the font.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Weight {
    Regular,
    Bold,
}

pub(crate) fn data(weight: Weight) -> &'static [u8] {
    match weight {
        Weight::Regular => dejavu::sans::regular(),
        Weight::Bold => dejavu::sans::bold(),
    }
}

/// Returns the width of a line of text in px.
pub(crate) fn width(text: &str, size: f64, weight: Weight) -> f64 {
    let Ok(font) = FontRef::new(data(weight)) else { return 0.6 * size * text.chars().count() as f64 };
    let glyphs = font.charmap();
    let metrics = font.glyph_metrics(Size::new(1000.0), LocationRef::default());
    // The viewer substitutes a character that DejaVu lacks. Its width is unknown: one em at
    // most.
    let advance =
        |c: char| glyphs.map(c).and_then(|glyph| metrics.advance_width(glyph)).map_or(1.0, |w| f64::from(w) / 1000.0);
    size * text.chars().map(advance).sum::<f64>()
}

/// Breaks a text at spaces into lines of at most `limit` px. Words longer than a line are
/// split.
pub(crate) fn wrap(text: &str, size: f64, weight: Weight, limit: f64) -> Vec<String> {
    let fits = |line: &str| width(line, size, weight) <= limit;
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if fits(&format!("{line} {word}")) => {
                line.push(' ');
                line.push_str(word);
            }
            _ if fits(word) => lines.push(word.to_owned()),
            _ => {
                let mut piece = String::new();
                for c in word.chars() {
                    piece.push(c);
                    if !fits(&piece) && piece.chars().count() > 1 {
                        piece.pop();
                        lines.push(std::mem::replace(&mut piece, c.to_string()));
                    }
                }
                lines.push(piece);
            }
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_font_is_there_and_measures_subscripts() {
        let w = width("a₁ Ω µ ∮ ≤ ×10⁻³", 12.0, Weight::Regular);
        assert!((80.0..150.0).contains(&w), "{w}");
        let font = FontRef::new(data(Weight::Bold)).unwrap();
        for c in "a₁₂₃₀₉ₐₑ⁻⁰¹²³⁴⁵⁶⁷⁸⁹αβΩωµ∮≤≥×°é".chars() {
            assert!(font.charmap().map(c).is_some_and(|g| g.to_u32() > 0), "{c}");
        }
        assert_eq!(wrap("one two three", 12.0, Weight::Regular, 60.0), ["one two", "three"]);
        let pieces = wrap("a wordthatistoolong", 12.0, Weight::Regular, 60.0);
        assert!(pieces.len() > 2 && pieces.iter().all(|p| width(p, 12.0, Weight::Regular) <= 60.0), "{pieces:?}");
        assert_eq!(pieces[1..].concat(), "wordthatistoolong");
        assert!(wrap(" ", 12.0, Weight::Regular, 60.0).is_empty());
    }
}
