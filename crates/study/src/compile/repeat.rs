//! Repetition: one entry of a list states several elements, one for every value of an index.
//!
//! `repeat = { i = 12 }` states the entry for i = 1, 2 … 12. In its names, `{i}` stands for the
//! value and `{i+1}` for the next one. In its expressions, `i` is a bare number. Several
//! indices make a grid; the first one changes slowest.

use crate::syntax::expression::Expression;
use crate::syntax::units::TextError;

/// The index of a repetition: its first and last value, and whether values beyond them wrap
/// around in names.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Index {
    pub name: String,
    pub from: i64,
    pub to: i64,
    pub wrap: bool,
}

/// The indices of an entry.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Repetition {
    pub indices: Vec<Index>,
}

impl Repetition {
    /// Returns the number of elements that the entry states; one without an index.
    pub fn count(&self) -> usize {
        let count = |index: &Index| usize::try_from(index.to - index.from + 1).unwrap_or(0);
        self.indices.iter().map(count).fold(1, usize::saturating_mul)
    }

    /// Returns the element with this number, from 0.
    pub fn iteration(&self, number: usize) -> Iteration<'_> {
        let mut rest = number as i64;
        let mut values = vec![0; self.indices.len()];
        for (value, index) in values.iter_mut().zip(&self.indices).rev() {
            let length = index.to - index.from + 1;
            *value = index.from + rest % length;
            rest /= length;
        }
        Iteration { indices: &self.indices, values }
    }
}

/// One element of a repetition: the values of its indices.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Iteration<'a> {
    indices: &'a [Index],
    values: Vec<i64>,
}

impl Iteration<'_> {
    /// Returns the value of an index.
    pub fn value(&self, name: &str) -> Option<f64> {
        let position = self.indices.iter().position(|index| index.name == name)?;
        Some(self.values[position] as f64)
    }

    /// Returns the names of the indices.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.indices.iter().map(|index| index.name.as_str())
    }

    /// Describes the indices in words: `i = 3, j = 1`; empty without an index.
    pub fn description(&self) -> String {
        let words = self.indices.iter().zip(&self.values).map(|(index, value)| format!("{} = {value}", index.name));
        words.collect::<Vec<_>>().join(", ")
    }

    /// Replaces the braces in a name by their values.
    ///
    /// # Errors
    /// [`TextError`] with the byte range of `text` that is wrong.
    pub fn name(&self, text: &str) -> Result<String, TextError> {
        let mut name = String::new();
        let mut position = 0;
        while let Some(open) = text[position..].find('{').map(|i| position + i) {
            let Some(close) = text[open..].find('}').map(|i| open + i) else {
                return Err(
                    TextError::new(open..text.len(), "this brace is not closed").help("write it as in \"blade{i}\"")
                );
            };
            name.push_str(&text[position..open]);
            let inner = &text[open + 1..close];
            let value = self.whole_number(inner).map_err(|mut fault| {
                fault.span = open + 1 + fault.span.start..open + 1 + fault.span.end;
                fault
            })?;
            name.push_str(&value.to_string());
            position = close + 1;
        }
        name.push_str(&text[position..]);
        Ok(name)
    }

    /// Evaluates the whole number inside braces.
    fn whole_number(&self, inner: &str) -> Result<i64, TextError> {
        let names: Vec<&str> = self.names().collect();
        let expression = Expression::compile_with(inner, &|_| None, &|name| self.value(name), &names)?;
        let value = expression.evaluate(&[])?;
        let whole = value.si as i64;
        if value.dimension.is_some() || whole as f64 != value.si {
            let message = format!("a name needs a whole number, found {}", value.si);
            return Err(TextError::new(0..inner.len(), message));
        }
        let word = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let used = |index: &&Index| inner.split(|c| !word(c)).any(|part| part == index.name);
        match self.indices.iter().filter(used).collect::<Vec<_>>()[..] {
            [index] if index.wrap => Ok(index.from + (whole - index.from).rem_euclid(index.to - index.from + 1)),
            [_, _, ..] if self.indices.iter().filter(used).any(|index| index.wrap) => {
                Err(TextError::new(0..inner.len(), "with `wrap`, braces must contain exactly one index")
                    .help("write \"m{i}_{j}\""))
            }
            _ => Ok(whole),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn index(name: &str, from: i64, to: i64, wraps: bool) -> Index {
        Index { name: name.to_owned(), from, to, wrap: wraps }
    }

    #[test]
    fn names_are_filled_in() {
        let ring = Repetition { indices: vec![index("i", 1, 12, true)] };
        let name = |number, text: &str| ring.iteration(number).name(text).unwrap();
        assert_eq!((ring.count(), name(0, "blade{i}").as_str()), (12, "blade1"));
        assert_eq!(name(11, "blade{i}_to_{i+1}"), "blade12_to_1");
        assert_eq!(name(0, "blade{i - 1}"), "blade12");
        assert_eq!(name(0, "blade{i+24}"), "blade1");
        assert_eq!(name(2, "plain"), "plain");
        let open = Repetition { indices: vec![index("i", 2, 4, false)] };
        assert_eq!(open.iteration(2).name("b{2*i+1}").unwrap(), "b9");
        for (text, words) in
            [("b{i", "not closed"), ("b{i/2}", "whole number, found 1.5"), ("b{k}", "no parameter"), ("b{}", "empty")]
        {
            let fault = open.iteration(1).name(text).unwrap_err();
            assert!(fault.message.contains(words), "{text}: {}", fault.message);
        }
        assert!(open.iteration(1).name("b{1 kg}").is_err());
    }

    #[test]
    fn a_grid_turns_the_last_index_fastest() {
        let grid = Repetition { indices: vec![index("i", 1, 3, true), index("j", 5, 6, false)] };
        let words: Vec<String> = (0..grid.count()).map(|n| grid.iteration(n).description()).collect();
        assert_eq!(words[..3], ["i = 1, j = 5", "i = 1, j = 6", "i = 2, j = 5"]);
        assert_eq!((words.len(), words[5].as_str()), (6, "i = 3, j = 6"));
        assert_eq!(grid.iteration(5).name("m{i+1}_{j+1}").unwrap(), "m1_7");
        assert!(grid.iteration(5).name("m{i+j}").unwrap_err().message.contains("one index"));
        assert_eq!(Repetition::default().iteration(0).description(), "");
    }
}
