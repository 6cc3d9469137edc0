//! Ready models: those of the paper, and bladed disks.
//!
//! Each template is one file, `templates/NAME.toml`, and a whole study. Another study uses its
//! model with `model = { template = "NAME" }` and sets the parameters that it wants to change.
//!
//! The file of a template documents itself. Its first line, a comment, is the summary.
//! `[parameters]` are its parameters, and the comment behind each one describes it in the book
//! and in the lists.
//!
//! To add a template, write its file and add its name to [`TABLE`]. The reader computes the
//! parameters and the model from the file.

/// A ready model with named parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Template {
    /// Name in study files.
    pub name: &'static str,
    /// Text of its file: a whole study, for `stickslip new`.
    pub study: &'static str,
}

macro_rules! templates {
    ($($name:literal),* $(,)?) => {
        &[$(Template { name: $name, study: include_str!(concat!("../../templates/", $name, ".toml")) }),*]
    };
}

/// All templates.
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
    "under-platform-cylinder",
];

/// Returns the template with this name.
pub fn find(name: &str) -> Option<&'static Template> {
    TABLE.iter().find(|template| template.name == name)
}

/// Returns the name of the template that is most similar to an unknown name.
///
/// # Example
/// ```
/// use stickslip_study::templates;
/// assert_eq!(templates::suggest("bladed-rign"), Some("bladed-ring"));
/// assert_eq!(templates::suggest("bicycle"), None);
/// ```
pub fn suggest(name: &str) -> Option<&'static str> {
    crate::syntax::suggest::suggest(name, TABLE.iter().map(|template| template.name))
}

impl Template {
    /// Returns the first line of its file, which describes it.
    pub fn summary(&self) -> &'static str {
        trailing_comment(self.study, 0)
    }
}

/// Returns the comment that fills the rest of the line after byte `at`; empty if there is none.
pub(crate) fn trailing_comment(text: &str, at: usize) -> &str {
    let line = text[at..].lines().next().unwrap_or("");
    line.trim_start().strip_prefix('#').map_or("", str::trim)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comment_ends_with_its_line() {
        assert_eq!(trailing_comment("# a \n# b", 0), "a");
        assert_eq!(trailing_comment("m = 1   # kg # or so", 5), "kg # or so");
        assert_eq!(trailing_comment("m = 1\n# b", 5), "");
        assert_eq!(trailing_comment("m = 1", 5), "");
    }
}
