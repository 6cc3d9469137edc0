//! The files of the page. They are part of the program, so the page needs no other host.

use stickslip_report::html;

/// A file of the page.
pub(crate) struct Asset {
    pub kind: &'static str,
    pub content: &'static str,
}

/// The page itself.
pub(crate) const PAGE: &str = include_str!("../../client/index.html");

const STYLE: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";

macro_rules! modules {
    ($($name:literal),* $(,)?) => {
        &[$((concat!("/assets/", $name), include_str!(concat!("../../client/", $name)))),*]
    };
}

/// The modules of the page, by address.
const MODULES: &[(&str, &str)] = modules![
    "main.js",
    "api.js",
    "dom.js",
    "design.js",
    "fit.js",
    "follow.js",
    "format.js",
    "gallery.js",
    "mistuning.js",
    "motion.js",
    "moving_loops.js",
    "orbit.js",
    "output.js",
    "parameters.js",
    "pins.js",
    "plot.js",
    "response.js",
    "scene.js",
    "solid.js",
    "store.js",
    "trust.js",
];

/// Returns the file at an address.
pub(crate) fn find(address: &str) -> Option<Asset> {
    let script = |content| Asset { kind: SCRIPT, content };
    match address {
        "/assets/style.css" => Some(Asset { kind: STYLE, content: include_str!("../../client/style.css") }),
        "/assets/plotly.js" => Some(script(html::script())),
        _ => MODULES.iter().find(|(known, _)| *known == address).map(|(_, content)| script(content)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every import and every file that the page names exists, and nothing comes from elsewhere.
    #[test]
    fn the_page_needs_its_own_files_only() {
        let mut named = 0;
        for (name, text) in MODULES.iter().copied().chain([("page", PAGE)]) {
            for quoted in text.split(['"', '\'']).filter(|quoted| quoted.ends_with(".js") || quoted.ends_with(".css")) {
                let address = format!("/assets/{}", quoted.trim_start_matches("./").trim_start_matches("assets/"));
                assert!(find(&address).is_some(), "{name}: {quoted}");
                named += 1;
            }
            for scheme in ["http://", "https://"] {
                let foreign =
                    text.match_indices(scheme).filter(|(at, _)| !text[*at..].starts_with("http://www.w3.org/"));
                assert_eq!(foreign.count(), 0, "{name}: {scheme}");
            }
        }
        assert!(named > MODULES.len(), "{named}");
        assert!(find("/assets/../Cargo.toml").is_none() && find("/assets/none.js").is_none());
    }

    /// The policy of the page forbids scripts in elements and attributes.
    #[test]
    fn the_page_has_no_inline_script() {
        assert!(
            PAGE.match_indices("<script").all(|(at, _)| PAGE[at..].starts_with("<script src=")
                || PAGE[at..].starts_with("<script type=\"module\" src="))
        );
        assert!(!PAGE.contains(" onclick") && !PAGE.contains("javascript:"));
    }
}
