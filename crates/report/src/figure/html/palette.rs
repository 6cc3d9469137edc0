//! Helpers shared by traces and layout: colours for light and dark pages, axis names, literal
//! text.

use crate::figure::axis::{self, AxisRange};
use crate::figure::colour::Colour;
use crate::figure::panels::{AREA, ColourScheme};
use crate::figure::svg::escape;
use std::collections::BTreeMap;
use stickslip_study::dataset::Figure;

/// Colours of text, background, axes, grid, fine grid and zero line, with their dark
/// counterparts.
pub(super) const TEXT: &str = "#1a1a1a";
pub(super) const GROUND: &str = "#ffffff";
pub(super) const LINE: &str = "#444444";
pub(super) const GRID: &str = "#e3e3e3";
pub(super) const FINE_GRID: &str = "#f2f2f2";
pub(super) const ZERO: &str = "#b0b0b0";
const DARK: [[&str; 2]; 6] = [
    [TEXT, "#e4e6ea"],
    [GROUND, "#16181d"],
    [LINE, "#9aa0a8"],
    [GRID, "#2e323a"],
    [FINE_GRID, "#22252b"],
    [ZERO, "#5a606a"],
];

/// Colours of a figure: the scheme on white, and the map to the dark counterparts.
pub(super) struct Palette {
    pub(super) scheme: ColourScheme,
    pub(super) dark: BTreeMap<String, String>,
}

impl Palette {
    pub(super) fn new(figure: &Figure) -> Palette {
        let dark = DARK.iter().map(|[light, dark]| ((*light).to_owned(), (*dark).to_owned())).collect();
        Palette { scheme: ColourScheme::of(figure), dark }
    }

    /// Returns the colour for the script and records its dark counterpart.
    pub(super) fn register(&mut self, colour: &Colour) -> String {
        self.dark.insert(colour.light.clone(), colour.dark.clone());
        colour.light.clone()
    }

    /// Returns the transparent colour of an area and records its dark counterpart.
    pub(super) fn area(&mut self, colour: &Colour) -> String {
        let [light, dark] = [&colour.light, &colour.dark].map(|c| format!("{c}{:02x}", (AREA * 255.0).round() as u8));
        self.dark.insert(light.clone(), dark);
        light
    }
}

/// Returns the name of a panel's axis in plotly's numbering: x, x2, x3, …
pub(super) fn axis_name(letter: &str, panel: usize) -> String {
    if panel == 0 { letter.to_owned() } else { format!("{letter}{}", panel + 1) }
}

/// Escapes text so that plotly does not interpret tags or templates in it.
pub(super) fn plain(text: &str) -> String {
    escape(text).replace("&quot;", "\"").replace("&#39;", "'").replace("%{", "%\u{200b}{")
}

/// Returns the power of ten factored out of an axis, as in the static figure.
pub(super) fn power(range: AxisRange) -> i32 {
    axis::ticks(range, 6.0).power
}
