//! Models that come ready: the paper's. Each is one file, `templates/NAME.toml`, a whole study to start from; another
//! study takes its model with `model = { template = "NAME" }` and gives those parameters that it wants otherwise.
//!
//! What is known of a template stands in its file: its first line, a comment, is the summary, `[parameters]` are its
//! parameters, and the comment behind each is what the book and the lists say of it.
//!
//! To add one: write its file, then its name in [`TABLE`].

use crate::error::StudyError;
use crate::near::nearest;
use crate::read::compile_template;
use stickslip::dimension::Dimension;
use stickslip::model::Model;

/// A ready model with named parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Template {
    /// Name in study files.
    pub name: &'static str,
    /// Its file: a whole study, for `stickslip new`.
    pub study: &'static str,
}

/// A parameter of a template.
#[derive(Debug, Clone, PartialEq)]
pub struct TemplateParameter {
    /// Name.
    pub key: String,
    /// Physical dimension: that of the default; a bare number counts as a pure one.
    pub dimension: Dimension,
    /// Default as in the file: a quantity, or an expression over other parameters.
    pub default: String,
    /// The same number in SI, with the other parameters at their defaults.
    pub value: f64,
    /// One line.
    pub doc: String,
}

macro_rules! templates {
    ($($name:literal),* $(,)?) => {
        &[$(Template { name: $name, study: include_str!(concat!("../templates/", $name, ".toml")) }),*]
    };
}

/// Every template there is.
pub const TABLE: &[Template] =
    templates!["element", "element-with-mass", "blade-couple", "blade-couple-massless", "symmetric-couple"];

/// The template with this name.
pub fn find(name: &str) -> Option<&'static Template> {
    TABLE.iter().find(|template| template.name == name)
}

impl Template {
    /// One line of what it is.
    pub fn summary(&self) -> &'static str {
        comment_behind(self.study, 0)
    }

    /// Its parameters, in the order of the file.
    ///
    /// # Example
    /// ```
    /// let couple = stickslip_study::templates::find("blade-couple").unwrap();
    /// let limit = couple.parameters().into_iter().find(|parameter| parameter.key == "Ft").unwrap();
    /// assert_eq!((limit.default.as_str(), limit.value, limit.doc.as_str()), ("2 N", 2.0, "slip limit"));
    /// ```
    ///
    /// # Panics
    /// If the file is wrong; those of [`TABLE`] are tested.
    pub fn parameters(&self) -> Vec<TemplateParameter> {
        let compiled = compile_template(self).and_then(|compiled| Ok((compiled.values(&[])?, compiled)));
        let (values, compiled) = compiled.unwrap_or_else(|error| panic!("template {}: {error}", self.name));
        let mut parameters = Vec::with_capacity(values.len());
        for (i, value) in values.iter().enumerate() {
            let quantity = &compiled.parameters[i].quantity;
            parameters.push(TemplateParameter {
                key: compiled.names[i].clone(),
                dimension: value.dimension.unwrap_or(Dimension::NONE),
                default: quantity.text.clone(),
                value: value.si,
                doc: comment_behind(self.study, quantity.place.span.end).to_owned(),
            });
        }
        parameters
    }

    /// The model with every parameter at its default.
    ///
    /// # Panics
    /// If the file is wrong; those of [`TABLE`] are tested.
    pub fn model(&self) -> Model {
        self.model_with(&[]).unwrap_or_else(|error| panic!("template {}: {error}", self.name))
    }

    /// The model with some parameters changed (SI). A parameter whose default is an expression over changed ones
    /// follows them, unless it is given too.
    ///
    /// # Errors
    /// [`StudyError`]: a name that is no parameter of this template, or values that the model cannot have.
    ///
    /// # Example
    /// ```
    /// let couple = stickslip_study::templates::find("blade-couple").unwrap();
    /// let model = couple.model_with(&[("Ft", 4.0), ("m", 0.2)]).unwrap();
    /// assert_eq!(model.joints[0].law.values(), [4.0]);
    /// assert_eq!(model.masses[1].mass, 0.002);   // m1 = m/100
    /// let error = couple.model_with(&[("Fx", 4.0)]).unwrap_err();
    /// assert!(error.message().contains("no parameter `Fx`"));
    /// assert!(couple.model_with(&[("Ft", -1.0)]).is_err());
    /// ```
    pub fn model_with(&self, changes: &[(&str, f64)]) -> Result<Model, StudyError> {
        let compiled = compile_template(self)?;
        let mut fixed = Vec::with_capacity(changes.len());
        for (name, si) in changes {
            let Some(index) = compiled.names.iter().position(|known| known == name) else {
                let help = nearest(name, compiled.names.iter().map(String::as_str));
                let help = help.map(|near| format!("did you mean `{near}`?"));
                return Err(StudyError::file(self.name, format!("there is no parameter `{name}`"), help));
            };
            fixed.push((index, *si));
        }
        compiled.model(&fixed)
    }
}

/// The comment that is all there is between this byte and the end of its line; empty if there is none.
fn comment_behind(text: &str, at: usize) -> &str {
    let line = text[at..].lines().next().unwrap_or("");
    line.trim_start().strip_prefix('#').map_or("", str::trim)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_template_says_what_it_and_each_of_its_parameters_is() {
        for template in TABLE {
            assert!(!template.summary().is_empty(), "{}: the first line is no comment", template.name);
            for parameter in template.parameters() {
                let place = format!("{}, {}", template.name, parameter.key);
                assert!(!parameter.doc.is_empty(), "{place}: no comment stands behind it");
                assert!(parameter.value.is_finite() && parameter.dimension != Dimension::NONE, "{place}");
            }
        }
    }

    #[test]
    fn a_comment_ends_with_its_line() {
        assert_eq!(comment_behind("# a \n# b", 0), "a");
        assert_eq!(comment_behind("m = 1   # kg # or so", 5), "kg # or so");
        assert_eq!(comment_behind("m = 1\n# b", 5), "");
        assert_eq!(comment_behind("m = 1", 5), "");
    }
}
