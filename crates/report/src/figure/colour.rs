//! Colours of the figures: a palette for named curves, a sequential scale for values, and
//! greys.
//!
//! Every colour has a counterpart for dark screens. The palette is that of Okabe and Ito (2008)
//! without the yellow, which is invisible on paper. Its dark counterparts keep the smallest
//! distance between two colours for every kind of colour vision.
//!
//! The scale has equal steps in the colour space OKLab (Ottosson 2020), from dark blue through
//! green to light yellow. Its lightness alone carries the value. The tests check these
//! properties.

/// Palette on white and on dark, in the order of `Series::colour`; the index wraps around.
pub(crate) const PALETTE: [[&str; 2]; 7] = [
    ["#0072b2", "#2f7fc9"],
    ["#d55e00", "#ff8616"],
    ["#009e73", "#2dc181"],
    ["#cc79a7", "#c896d8"],
    ["#e69f00", "#ecd65f"],
    ["#56b4e9", "#aeddf5"],
    ["#222222", "#fffed8"],
];

/// Sequential scale on white and on dark, in equal steps from the smallest to the largest
/// value.
const SCALE: [[&str; 2]; 17] = [
    ["#370c6f", "#6b4cae"],
    ["#30207e", "#615bbe"],
    ["#243188", "#526ac9"],
    ["#10428a", "#3e79d0"],
    ["#005187", "#2488d2"],
    ["#025c84", "#0297ce"],
    ["#026984", "#02a2c8"],
    ["#047785", "#07aec2"],
    ["#038485", "#01bbbd"],
    ["#019082", "#08c6b6"],
    ["#019b7d", "#28d0ab"],
    ["#24a672", "#52d99d"],
    ["#4caf63", "#7be08d"],
    ["#73b552", "#a0e47e"],
    ["#96ba44", "#c3e772"],
    ["#b6bd39", "#e3e96a"],
    ["#d5bf36", "#ffea6c"],
];

/// A colour on white and its counterpart on dark.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Colour {
    pub light: String,
    pub dark: String,
}

impl Colour {
    fn pair([light, dark]: [&str; 2]) -> Colour {
        Colour { light: light.to_owned(), dark: dark.to_owned() }
    }

    /// Returns a colour of the palette.
    pub(crate) fn palette(index: usize) -> Colour {
        Colour::pair(PALETTE[index % PALETTE.len()])
    }

    /// Legend colour of a label that is drawn in several colours.
    pub(crate) fn several() -> Colour {
        Colour::pair(["#555555", "#b8b8b8"])
    }

    /// Colour of references.
    pub(crate) fn reference() -> Colour {
        Colour::pair(["#777777", "#9a9a9a"])
    }

    /// Colour of contour lines, which is that of the page. Every colour of the sequential scale
    /// contrasts with it.
    pub(crate) fn background() -> Colour {
        Colour::pair(["#ffffff", "#16181d"])
    }

    /// Returns the colour at a relative position of the sequential scale, from 0 to 1.
    pub(crate) fn sequential(part: f64) -> Colour {
        let steps = (SCALE.len() - 1) as f64;
        let place = if part.is_nan() { 0.0 } else { part.clamp(0.0, 1.0) * steps };
        let low = (place.floor() as usize).min(SCALE.len() - 2);
        let between = |dark: usize| {
            let [a, b] = [low, low + 1].map(|i| channels(SCALE[i][dark]));
            let mixed = [0, 1, 2].map(|i| (a[i] + (b[i] - a[i]) * (place - low as f64)).round() as u8);
            format!("#{:02x}{:02x}{:02x}", mixed[0], mixed[1], mixed[2])
        };
        Colour { light: between(0), dark: between(1) }
    }
}

/// Returns red, green and blue of `#rrggbb`, from 0 to 255. Invalid channels are 0.
fn channels(colour: &str) -> [f64; 3] {
    [1, 3, 5].map(|i| colour.get(i..i + 2).and_then(|h| u8::from_str_radix(h, 16).ok()).map_or(0.0, f64::from))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// OKLab of linear red, green and blue (Ottosson 2020).
    fn oklab([r, g, b]: [f64; 3]) -> [f64; 3] {
        let l = (0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b).cbrt();
        let m = (0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b).cbrt();
        let s = (0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b).cbrt();
        [
            0.2104542553 * l + 0.7936177850 * m - 0.0040720468 * s,
            1.9779984951 * l - 2.4285922050 * m + 0.4505937099 * s,
            0.0259040371 * l + 0.7827717662 * m - 0.8086757660 * s,
        ]
    }

    fn linear(colour: &str) -> [f64; 3] {
        channels(colour).map(|c| {
            let c = c / 255.0;
            if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        })
    }

    fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
        (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
    }

    /// Contrast of two colours as accessibility guidelines define it (WCAG 2), 1 to 21.
    fn contrast(a: &str, b: &str) -> f64 {
        let light = |c: &str| {
            let [r, g, b] = linear(c);
            0.2126 * r + 0.7152 * g + 0.0722 * b + 0.05
        };
        let (a, b) = (light(a), light(b));
        a.max(b) / a.min(b)
    }

    /// Normal vision, protanopia, deuteranopia and tritanopia (Machado, Oliveira, Fernandes
    /// 2009).
    const VISION: [[[f64; 3]; 3]; 4] = [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
    ];

    fn seen(colour: &str, vision: usize) -> [f64; 3] {
        let rgb = linear(colour);
        oklab(VISION[vision].map(|row| (0..3).map(|i| row[i] * rgb[i]).sum::<f64>().clamp(0.0, 1.0)))
    }

    #[test]
    fn any_two_colours_of_the_palette_differ_for_every_kind_of_colour_vision() {
        // The limit is three times 0.025, the step that a reader distinguishes side by side.
        for dark in [0, 1] {
            for vision in 0..VISION.len() {
                for i in 0..PALETTE.len() {
                    for j in 0..i {
                        let far = distance(seen(PALETTE[i][dark], vision), seen(PALETTE[j][dark], vision));
                        assert!(far > 0.075, "{} and {}: {far}", PALETTE[i][dark], PALETTE[j][dark]);
                    }
                }
            }
        }
    }

    #[test]
    fn every_colour_stands_out_from_its_background() {
        for (dark, ground, least) in [(0, "#ffffff", 2.2), (1, "#16181d", 3.5)] {
            let greys = [Colour::several(), Colour::reference()].map(|c| if dark == 0 { c.light } else { c.dark });
            for colour in PALETTE.iter().map(|pair| pair[dark]).chain(greys.iter().map(String::as_str)) {
                assert!(contrast(colour, ground) > least, "{colour}: {}", contrast(colour, ground));
            }
        }
        assert!(SCALE.iter().all(|[light, dark]| contrast(light, "#ffffff") > 1.7 && contrast(dark, "#16181d") > 2.5));
    }

    #[test]
    fn the_scale_goes_in_equal_steps_from_dark_to_light() {
        for dark in [0, 1] {
            let lab: Vec<[f64; 3]> = SCALE.iter().map(|pair| oklab(linear(pair[dark]))).collect();
            let steps: Vec<f64> = lab.windows(2).map(|w| distance(w[0], w[1])).collect();
            let mean = steps.iter().sum::<f64>() / steps.len() as f64;
            assert!(steps.iter().all(|s| (s / mean - 1.0).abs() < 0.2), "{steps:?}");
            // In grey, the lightness increases with every step.
            assert!(lab.windows(2).all(|w| w[1][0] - w[0][0] > 0.015), "{lab:?}");
        }
    }

    #[test]
    fn parts_of_the_scale_lie_between_its_steps() {
        assert_eq!(Colour::sequential(0.0).light, SCALE[0][0]);
        assert_eq!(Colour::sequential(1.0).dark, SCALE[16][1]);
        assert_eq!(Colour::sequential(2.0), Colour::sequential(1.0));
        assert_eq!(Colour::sequential(f64::NAN), Colour::sequential(0.0));
        // Half way between #370c6f and #30207e.
        assert_eq!(Colour::sequential(0.5 / 16.0).light, "#341677");
    }
}
