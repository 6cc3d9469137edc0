//! Templates: the model of the template that a study names, and the parameters and model of
//! each template.

use super::reader::Reader;
use crate::case::study::{Parameter, case_model, evaluate};
use crate::compile::compiled::Environment;
use crate::compile::mesh::MeshUse;
use crate::compile::source_model::{ModelLists, SourceModel, TemplateSource};
use crate::compile::templates::{self, Template, trailing_comment};
use crate::syntax::document::{self, TomlTable, TomlValue};
use crate::syntax::error::{Problem, Source, StudyError};
use crate::syntax::expression::ExpressionValue;
use crate::syntax::schema::{FILE, ValueType};
use crate::syntax::suggest::suggest;
use std::collections::HashMap;
use std::sync::Arc;
use stickslip::dimension::Dimension;
use stickslip::model::Model;

/// The content of a template file without its study.
pub(super) struct TemplateFile {
    pub parameters: Vec<Parameter>,
    pub lists: ModelLists,
    /// Index of the file among the sources.
    pub source: usize,
}

/// Returns the template that `[model]` names, with its table.
pub(super) fn template_and_table(root: &TomlTable) -> Option<(&'static Template, &TomlTable)> {
    let TomlValue::Table(table) = &root.get("model")?.node.value else { return None };
    let TomlValue::Text { text, .. } = &table.get("template")?.node.value else { return None };
    Some((templates::find(text)?, table))
}

impl Reader {
    /// Reads a template file.
    ///
    /// It is read before the parameters of the study, so that its texts know only the
    /// template's parameters.
    pub(super) fn template(&mut self, row: &Template) -> Option<TemplateFile> {
        let source = self.text(format!("template {}", row.name), row.study.to_owned()).source;
        let root = match document::parse(row.study, source) {
            Ok(root) => root,
            Err(problem) => {
                self.problems.push(problem);
                return None;
            }
        };
        let mut parameters = self.parameters(&root, Vec::new(), &[])?;
        self.fix_dimensions(&mut parameters, &(0..self.names.len()).collect::<Vec<_>>())?;
        self.template = Some(source);
        Some(TemplateFile { parameters, lists: self.lists(&root)?, source })
    }

    /// Returns the model of a template, with the law that the study sets for its joints.
    pub(super) fn with_template(
        &mut self,
        root: &TomlTable,
        row: &Template,
        mut lists: ModelLists,
        table: &TomlTable,
        source: usize,
    ) -> Option<SourceModel> {
        for key in FILE.iter().filter(|key| matches!(key.takes, ValueType::List(_)) || key.name == "structure") {
            if let Some(entry) = root.get(key.name) {
                let message = format!(
                    "the template `{}` contains the whole model; `{}` cannot be added to it",
                    row.name, key.name
                );
                let help = format!(
                    "change its parameters, or start from `stickslip new {}`, which writes the model as lists",
                    row.name
                );
                self.problems.push(Problem::new(&entry.node.location, key.name, message).help(help));
            }
        }
        if let Some(entry) = root.get("disk") {
            match (&mut lists.disk, FILE.iter().find(|key| key.name == "disk").map(|key| key.takes), &entry.node.value)
            {
                (None, ..) => {
                    let message = format!("the template `{}` is not a sector of a disk", row.name);
                    self.problems.push(Problem::new(&entry.node.location, "disk", message));
                }
                (Some(own), Some(ValueType::Table(keys)), TomlValue::Table(table)) => {
                    *own = self.disk(table, keys)?;
                }
                _ => {
                    let message = format!("expected a table, found {}", entry.node.value.described());
                    self.problems.push(Problem::new(&entry.node.location, "disk", message));
                }
            }
        }
        let Some(ValueType::Table(keys)) = FILE.iter().find(|key| key.name == "model").map(|key| key.takes) else {
            return None;
        };
        let table = self.table(table, keys, "[model]");
        if let Some(law) = table.entry("law") {
            for entry in lists.joint.iter_mut().flat_map(|joint| &mut joint.entries).filter(|e| e.key == law.key) {
                entry.clone_from(law);
            }
        }
        Some(SourceModel {
            lists,
            template: Some(TemplateSource { table, source, given: Vec::new() }),
            matrices: None,
            mesh: MeshUse::default(),
        })
    }
}

/// The compiled model of a template with its parameters.
struct CompiledTemplate {
    names: Vec<String>,
    /// Each parameter has the dimension of its default, if the default has one.
    parameters: Vec<Parameter>,
    order: Vec<usize>,
    structure: SourceModel,
    sources: Vec<Arc<Source>>,
}

impl CompiledTemplate {
    /// Evaluates the parameters; `fixed` parameters have the given value, SI.
    fn values(&self, fixed: &[(usize, f64)]) -> Result<Vec<ExpressionValue>, StudyError> {
        let values = evaluate(&self.names, &self.parameters, &self.order, &HashMap::new(), fixed);
        values.map_err(|problem| StudyError::at_location(&self.sources, problem))
    }

    /// Builds the model; `fixed` parameters have the given value, SI.
    fn model(&self, fixed: &[(usize, f64)]) -> Result<Model, StudyError> {
        let environment = Environment { names: &self.names, parameters: &self.parameters, values: self.values(fixed)? };
        let mut problems = Vec::new();
        let reevaluate = |changed: &[(usize, f64)]| {
            let fixed: Vec<_> = fixed.iter().chain(changed).copied().collect();
            evaluate(&self.names, &self.parameters, &self.order, &HashMap::new(), &fixed)
        };
        let model = case_model(&self.structure, &environment, &reevaluate, &mut problems);
        StudyError::from_problems(&self.sources, problems).map_or(Ok(model), Err)
    }
}

/// Compiles the model of a template file.
///
/// # Errors
/// Returns a [`StudyError`] if the template file is wrong, which is a bug and not a user error.
fn compile_template(row: &Template) -> Result<CompiledTemplate, StudyError> {
    let mut reader = Reader::default();
    let stated = reader.template(row);
    let order = stated.as_ref().and_then(|stated| reader.order(&stated.parameters, &[]));
    match (stated, order) {
        (Some(TemplateFile { parameters, lists, .. }), Some(order)) if reader.problems.is_empty() => {
            let structure = SourceModel { lists, template: None, matrices: None, mesh: MeshUse::default() };
            Ok(CompiledTemplate { names: reader.names, parameters, order, structure, sources: reader.sources })
        }
        _ => Err(reader.error(row.name)),
    }
}

/// A parameter of a template.
#[derive(Debug, Clone, PartialEq)]
pub struct TemplateParameter {
    /// Name.
    pub key: String,
    /// Physical dimension of the default; a bare number counts as a pure number.
    pub dimension: Dimension,
    /// Default as in the file: a quantity, or an expression over other parameters.
    pub default: String,
    /// The default in SI, with the other parameters at their defaults.
    pub value: f64,
    /// One-line description.
    pub doc: String,
}

impl Template {
    /// Returns the parameters in file order.
    ///
    /// # Example
    /// ```
    /// let couple = stickslip_study::templates::find("blade-couple").unwrap();
    /// let limit =
    ///     couple.parameters().into_iter().find(|parameter| parameter.key == "Ft").unwrap();
    /// assert_eq!(
    ///     (limit.default.as_str(), limit.value, limit.doc.as_str()),
    ///     ("2 N", 2.0, "slip limit")
    /// );
    /// ```
    ///
    /// # Panics
    /// If the file is wrong; those of [`TABLE`](crate::compile::templates::TABLE) are tested.
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
                doc: trailing_comment(self.study, quantity.location.span.end).to_owned(),
            });
        }
        parameters
    }

    /// Returns the model with every parameter at its default.
    ///
    /// # Panics
    /// If the file is wrong; those of [`TABLE`](crate::compile::templates::TABLE) are tested.
    pub fn model(&self) -> Model {
        self.model_with(&[]).unwrap_or_else(|error| panic!("template {}: {error}", self.name))
    }

    /// Returns the model with some parameters changed (SI).
    ///
    /// A parameter whose default is an expression over changed parameters follows them, unless
    /// it is changed too.
    ///
    /// # Errors
    /// Returns a [`StudyError`] if a name is not a parameter of this template, or if the model
    /// refuses a value.
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
                let help = suggest(name, compiled.names.iter().map(String::as_str));
                let help = help.map(|near| format!("did you mean `{near}`?"));
                return Err(StudyError::file(self.name, format!("there is no parameter `{name}`"), help));
            };
            fixed.push((index, *si));
        }
        compiled.model(&fixed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compile::templates::TABLE;

    #[test]
    fn every_template_says_what_it_and_each_of_its_parameters_is() {
        for template in TABLE {
            assert!(!template.summary().is_empty(), "{}: the first line is no comment", template.name);
            for parameter in template.parameters() {
                let place = format!("{}, {}", template.name, parameter.key);
                assert!(!parameter.doc.is_empty(), "{place}: no comment stands behind it");
                let counted = ["N", "EO", "mu"].contains(&parameter.key.as_str());
                assert!(parameter.value.is_finite() && (counted || parameter.dimension != Dimension::NONE), "{place}");
            }
        }
    }
}
