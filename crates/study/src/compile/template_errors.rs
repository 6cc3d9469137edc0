//! Finds the user's values that make an expression of a template wrong.
//!
//! The user did not write the template's text, so the error is reported at the values.

use crate::syntax::error::{Location, Problem};
use crate::syntax::expression::Expression;
use crate::syntax::suggest::excerpt;
use std::collections::BTreeSet;

/// The value of a parameter in a case, as stated.
pub(crate) struct StatedValue<'a> {
    pub text: &'a str,
    pub location: &'a Location,
    /// `None` for a value from a range.
    pub expression: Option<&'a Expression>,
}

/// Returns the parameters outside the template file on which the parameters `of` depend, `of`
/// included, in index order.
pub(crate) fn user_parameters(
    template: usize,
    stated: &[StatedValue<'_>],
    of: impl IntoIterator<Item = usize>,
) -> BTreeSet<usize> {
    let (mut found, mut open) = (BTreeSet::new(), of.into_iter().collect::<Vec<_>>());
    while let Some(next) = open.pop() {
        if found.insert(next) {
            open.extend(stated[next].expression.into_iter().flat_map(Expression::parameters));
        }
    }
    found.retain(|index| stated[*index].location.source != template);
    found
}

/// Moves a problem of a template parameter to the first user value that causes it; returns
/// other problems unchanged.
pub(crate) fn locate_at_user_value(
    problem: Problem,
    template: Option<usize>,
    names: &[String],
    stated: &[StatedValue<'_>],
) -> Problem {
    let Some(template) = template.filter(|source| *source == problem.location.source) else { return problem };
    let Some(wrong) = names.iter().position(|name| *name == problem.key) else { return problem };
    let given = user_parameters(template, stated, [wrong]);
    let Some(first) = given.first() else { return problem };
    let value = |index: &usize| format!("{} = {}", names[*index], excerpt(stated[*index].text.trim()));
    let values: Vec<String> = given.iter().map(value).collect();
    let Problem { key, message, help, .. } = problem;
    let text = stated[wrong].text.trim();
    let message =
        format!("with {}, the value `{text}` of the template parameter `{key}` is wrong: {message}", values.join(", "));
    Problem::new(stated[*first].location, names[*first].clone(), message).maybe_help(help)
}
