//! Models that come ready: the paper's, and bladed disks. Each is one file, `templates/NAME.toml`, a whole study to start from; another
//! study takes its model with `model = { template = "NAME" }` and gives those parameters that it wants otherwise.
//!
//! What is known of a template stands in its file: its first line, a comment, is the summary, `[parameters]` are its
//! parameters, and the comment behind each is what the book and the lists say of it.
//!
//! To add one: write its file, then its name in [`TABLE`]. What follows from a file, parameters and models, is computed by the reader.

/// A ready model with named parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Template {
    /// Name in study files.
    pub name: &'static str,
    /// Its file: a whole study, for `stickslip new`.
    pub study: &'static str,
}

macro_rules! templates {
    ($($name:literal),* $(,)?) => {
        &[$(Template { name: $name, study: include_str!(concat!("../templates/", $name, ".toml")) }),*]
    };
}

/// Every template there is.
pub const TABLE: &[Template] = templates![
    "element",
    "element-with-mass",
    "blade-couple",
    "blade-couple-massless",
    "symmetric-couple",
    "bladed-ring",
    "bladed-disk",
    "shroud",
    "rim-ring",
    "under-platform-wedge",
    "under-platform-rocking-wedge",
    "under-platform-cylinder",
];

/// The template with this name.
pub fn find(name: &str) -> Option<&'static Template> {
    TABLE.iter().find(|template| template.name == name)
}

/// The name of the template that was probably meant by another one.
///
/// # Example
/// ```
/// use stickslip_study::templates;
/// assert_eq!(templates::nearest("bladed-rign"), Some("bladed-ring"));
/// assert_eq!(templates::nearest("bicycle"), None);
/// ```
pub fn nearest(name: &str) -> Option<&'static str> {
    crate::near::nearest(name, TABLE.iter().map(|template| template.name))
}

impl Template {
    /// One line of what it is.
    pub fn summary(&self) -> &'static str {
        comment_behind(self.study, 0)
    }
}

/// The comment that is all there is between this byte and the end of its line; empty if there is none.
pub(crate) fn comment_behind(text: &str, at: usize) -> &str {
    let line = text[at..].lines().next().unwrap_or("");
    line.trim_start().strip_prefix('#').map_or("", str::trim)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comment_ends_with_its_line() {
        assert_eq!(comment_behind("# a \n# b", 0), "a");
        assert_eq!(comment_behind("m = 1   # kg # or so", 5), "kg # or so");
        assert_eq!(comment_behind("m = 1\n# b", 5), "");
        assert_eq!(comment_behind("m = 1", 5), "");
    }
}
