//! Suggestions for misspelled words.

/// Returns the candidate that is most similar to `word`, if one is similar enough.
pub(crate) fn suggest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // Words from a file can be megabytes long, and the distance costs the product of the
    // lengths. Numbers get no suggestion.
    if word.len() > 64 || word.starts_with(|first: char| first.is_ascii_digit()) {
        return None;
    }
    let lower = word.to_lowercase();
    candidates
        .into_iter()
        .filter_map(|candidate| {
            let other = candidate.to_lowercase();
            let distance = strsim::damerau_levenshtein(&lower, &other);
            let length = lower.chars().count().max(other.chars().count());
            // one typing error in a short word, a third of the letters in a long one; or an
            // abbreviation such as `freq`
            let is_similar = distance <= (length / 3).max(usize::from(length > 1));
            let abbreviation = lower.chars().count() >= 3 && other.starts_with(&lower);
            // one word of several, as in `frequency response` or `nonlinear modes`
            let parts = || lower.split(|c: char| !c.is_alphanumeric());
            let within = other.chars().count() >= 3 && parts().any(|part| part == other);
            (is_similar || abbreviation || within).then_some((distance, candidate))
        })
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// Formats a list as `` `a`, `b` or `c` ``.
pub(crate) fn alternatives<'a>(words: impl IntoIterator<Item = &'a str>) -> String {
    let words: Vec<String> = words.into_iter().map(|word| format!("`{word}`")).collect();
    match words.split_last() {
        None => "nothing".to_owned(),
        Some((only, [])) => only.clone(),
        Some((last, rest)) => format!("{} or {last}", rest.join(", ")),
    }
}

/// Makes a word of the file fit for one line of a message: replaces control characters and cuts
/// it to 60 characters.
pub(crate) fn excerpt(word: &str) -> String {
    let max_length = 60;
    let mut text: String =
        word.chars().take(max_length).map(|c| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c }).collect();
    if word.chars().nth(max_length).is_some() {
        text.push('…');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suggests_misspellings_and_abbreviations() {
        let keys = ["between", "stiffness", "damping"];
        assert_eq!(suggest("stifness", keys), Some("stiffness"));
        assert_eq!(suggest("Damping", keys), Some("damping"));
        assert_eq!(suggest("damp", keys), Some("damping"));
        assert_eq!(suggest("colour", keys), None);
        assert_eq!(suggest("viscous damping", keys), Some("damping"));
        assert_eq!((suggest("61", ["6", "1"]), suggest("61.x", ["6.x"])), (None, None));
        assert_eq!(suggest(&"x".repeat(100_000), keys), None);
        assert_eq!(alternatives(keys), "`between`, `stiffness` or `damping`");
    }
}
