//! Writes the figure as pixels: the SVG at twice its size, with the embedded font only.

use crate::figure::font::{self, Weight};
use crate::output::result_file::{File, Output, ReportError};
use resvg::{tiny_skia, usvg};
use stickslip_study::dataset::{Dataset, Figure};

/// The output `png`.
pub const OUTPUT: Output = Output {
    name: "png",
    summary: "figure.png, for documents that cannot take SVG",
    make: files,
    sink: None,
    is_default: true,
};

/// Pixels per unit of the SVG: a figure of 1000 units prints at 300 dpi on 170 mm.
const SCALE: f32 = 2.0;

fn files(dataset: &Dataset) -> Result<Vec<File>, ReportError> {
    Ok(vec![File::new("figure.png", to_png(&dataset.figure)?)])
}

/// Returns the figure as a PNG file with twice the size of the SVG.
///
/// The image is the same on every machine.
/// # Errors
/// [`ReportError::Encode`] if the figure cannot be drawn, for example because it is too large.
pub fn to_png(figure: &Figure) -> Result<Vec<u8>, ReportError> {
    let fail = |reason: &dyn std::fmt::Display| ReportError::encode("figure.png", reason);
    draw(figure)?.encode_png().map_err(|e| fail(&e))
}

fn draw(figure: &Figure) -> Result<tiny_skia::Pixmap, ReportError> {
    let tree = parsed(&crate::figure::svg::to_svg(figure))?;
    let size = tree.size();
    let pixels = |length: f32| (length * SCALE).ceil() as u32;
    let mut pixmap = tiny_skia::Pixmap::new(pixels(size.width()), pixels(size.height()))
        .ok_or_else(|| ReportError::encode("figure.png", "the figure has too many panels for one image"))?;
    resvg::render(&tree, tiny_skia::Transform::from_scale(SCALE, SCALE), &mut pixmap.as_mut());
    Ok(pixmap)
}

fn parsed(svg: &str) -> Result<usvg::Tree, ReportError> {
    let mut options = usvg::Options { font_family: "DejaVu Sans".into(), ..usvg::Options::default() };
    for weight in [Weight::Regular, Weight::Bold] {
        options.fontdb_mut().load_font_data(font::data(weight).to_vec());
    }
    options.fontdb_mut().set_sans_serif_family("DejaVu Sans");
    usvg::Tree::from_str(svg, &options).map_err(|e| ReportError::encode("figure.png", e))
}

/// Draws an SVG on a picture.
pub(super) fn draw_on(svg: &str, canvas: &mut tiny_skia::Pixmap) -> Result<(), ReportError> {
    resvg::render(&parsed(svg)?, tiny_skia::Transform::identity(), &mut canvas.as_mut());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;

    #[test]
    fn every_colour_of_the_palette_is_on_the_image() {
        let pixmap = draw(&samples::many().figure).unwrap();
        for colour in crate::figure::colour::PALETTE.map(|pair| pair[0]) {
            let rgb = u32::from_str_radix(&colour[1..], 16).unwrap();
            let close = |p: &tiny_skia::PremultipliedColorU8| {
                let near = |value: u8, shift: u32| i64::from(value).abs_diff(i64::from((rgb >> shift) & 255)) < 12;
                near(p.red(), 16) && near(p.green(), 8) && near(p.blue(), 0)
            };
            assert!(pixmap.pixels().iter().filter(|p| close(p)).count() > 300, "{colour}");
        }
    }

    #[test]
    fn text_is_drawn_without_the_fonts_of_the_machine() {
        // The dark pixels above the panels are the title.
        let pixmap = draw(&samples::response().figure).unwrap();
        let dark = pixmap.pixels().iter().take(pixmap.width() as usize * 70).filter(|p| p.red() < 100).count();
        assert!(dark > 500, "{dark}");
    }

    #[test]
    #[ignore = "writes the sample figures into the folder STICKSLIP_FIGURES, for the eye"]
    fn look() {
        let folder = std::path::PathBuf::from(std::env::var("STICKSLIP_FIGURES").unwrap());
        for dataset in samples::all() {
            let files = crate::write_dataset(&dataset, &folder, &crate::Outputs::all()).unwrap();
            let text = crate::terminal::Terminal::default().text(&dataset, &files);
            std::fs::write(folder.join(format!("{}.txt", dataset.name)), text).unwrap();
        }
        crate::page::tests::page().write(&folder.join("report.html")).unwrap();
    }
}
