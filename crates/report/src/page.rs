//! A report page: figures, the claims about them, the measured numbers and a verdict on each
//! claim.
//!
//! All figures share one script, which is a file in the folder of the page. In print, or
//! without the script, the page shows the static figures instead.

use crate::figure::html::{document, fragment, script, script_name};
use crate::figure::svg::escape;
use crate::output::result_file::{ReportError, write_file, write_if_changed};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use stickslip_study::dataset::Figure;

/// A report.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Page {
    /// Title of the page.
    pub title: String,
    /// Paragraphs before the first section.
    pub introduction: Vec<String>,
    /// Sections in order. A page with several sections has a table of contents.
    pub sections: Vec<Section>,
}

/// A section of a report: text, a figure, claims, tables. Each part is optional.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Section {
    /// Heading of the section.
    pub heading: String,
    /// Paragraphs before the figure.
    pub paragraphs: Vec<String>,
    /// The figure, shown interactively.
    pub figure: Option<Figure>,
    /// Claims about the figure, with measured values.
    pub claims: Vec<Claim>,
    /// Tables after the claims.
    pub tables: Vec<PageTable>,
}

/// A claim and its verdict.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Claim {
    /// Statement of the source.
    pub text: String,
    /// Measured values, with units.
    pub measured: String,
    /// Result of the comparison.
    pub verdict: Verdict,
}

/// Result of the comparison of a claim with measured values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// The claim holds.
    Holds,
    /// The claim holds within limits that `measured` names.
    HoldsWithQualification,
    /// The claim does not hold.
    DoesNotHold,
}

impl Verdict {
    /// All verdicts.
    pub const ALL: [Verdict; 3] = [Verdict::Holds, Verdict::HoldsWithQualification, Verdict::DoesNotHold];

    /// Returns the verdict as text.
    pub fn words(self) -> &'static str {
        match self {
            Verdict::Holds => "holds",
            Verdict::HoldsWithQualification => "holds with a qualification",
            Verdict::DoesNotHold => "does not hold",
        }
    }

    fn plural(self, count: usize) -> &'static str {
        match self {
            _ if count == 1 => self.words(),
            Verdict::Holds => "hold",
            Verdict::HoldsWithQualification => "hold with a qualification",
            Verdict::DoesNotHold => "do not hold",
        }
    }

    fn class(self) -> &'static str {
        match self {
            Verdict::Holds => "holds",
            Verdict::HoldsWithQualification => "partly",
            Verdict::DoesNotHold => "fails",
        }
    }

    /// Returns a sign that accompanies the colour, for print and for colour-blind readers.
    fn sign(self) -> &'static str {
        match self {
            Verdict::Holds => "✓",
            Verdict::HoldsWithQualification => "≈",
            Verdict::DoesNotHold => "✗",
        }
    }
}

/// A table of formatted text and numbers.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PageTable {
    /// Caption of the table; may be empty.
    pub caption: String,
    /// Column headings.
    pub header: Vec<String>,
    /// Rows; a missing cell is shown empty.
    pub rows: Vec<Vec<String>>,
}

impl Page {
    /// Returns the page as an HTML document that loads its script from its own folder.
    ///
    /// Equal pages give equal bytes.
    pub fn to_html(&self) -> String {
        let title = escape(&self.title);
        let mut body = format!("<header>\n<h1>{title}</h1>\n");
        paragraphs(&mut body, &self.introduction);
        self.summary(&mut body);
        if self.sections.len() > 1 {
            body.push_str("<nav aria-label=\"Contents\"><ol>\n");
            for (i, section) in self.sections.iter().enumerate() {
                let badges: String = section.claims.iter().map(|c| dot(c.verdict)).collect();
                let _ =
                    writeln!(body, "<li><a href=\"#section-{}\">{}</a> {badges}</li>", i + 1, escape(&section.heading));
            }
            body.push_str("</ol></nav>\n");
        }
        body.push_str("</header>\n<main>\n");
        for (i, section) in self.sections.iter().enumerate() {
            section.to_html(&mut body, i + 1);
        }
        body.push_str("</main>");
        document(&title, STYLE, &body, &script_name())
    }

    /// Writes the page completely or not at all, and the script of its figures if it is
    /// missing.
    /// # Errors
    /// [`ReportError::Write`] with the path and the cause.
    pub fn write(&self, path: &Path) -> Result<PathBuf, ReportError> {
        write_if_changed(&path.with_file_name(script_name()), script().as_bytes())?;
        write_file(path, self.to_html().as_bytes())
    }

    /// Returns the number of claims with this verdict.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.sections.iter().flat_map(|section| &section.claims).filter(|claim| claim.verdict == verdict).count()
    }

    fn summary(&self, body: &mut String) {
        let counts = Verdict::ALL.map(|v| (v, self.count(v)));
        let total: usize = counts.iter().map(|c| c.1).sum();
        if total == 0 {
            return;
        }
        let _ =
            write!(body, "<p class=\"summary\"><strong>{total} claim{}:</strong>", if total == 1 { "" } else { "s" });
        for (verdict, count) in counts.into_iter().filter(|c| c.1 > 0) {
            let _ = write!(body, " <span class=\"badge {}\">{count} {}</span>", verdict.class(), verdict.plural(count));
        }
        body.push_str("</p>\n");
    }
}

impl Section {
    fn to_html(&self, body: &mut String, number: usize) {
        let _ = writeln!(body, "<section id=\"section-{number}\">\n<h2>{}</h2>", escape(&self.heading));
        paragraphs(body, &self.paragraphs);
        if let Some(figure) = &self.figure {
            // The heading names the figure; its title appears only if it differs.
            if figure.title != self.heading && !figure.title.is_empty() {
                let _ = writeln!(body, "<h3>{}</h3>", escape(&figure.title));
            }
            let _ = writeln!(body, "{}", fragment(figure, &format!("figure-{number}")));
        }
        if !self.claims.is_empty() {
            body.push_str("<table class=\"claims\">\n<thead><tr><th>Claim</th><th>Measured</th><th>Verdict</th></tr></thead>\n<tbody>\n");
            for claim in &self.claims {
                let _ = writeln!(
                    body,
                    "<tr><td data-head=\"Claim\">{}</td><td data-head=\"Measured\">{}</td><td data-head=\"Verdict\">\
                     <span class=\"badge {}\">{} {}</span></td></tr>",
                    escape(&claim.text),
                    escape(&claim.measured),
                    claim.verdict.class(),
                    claim.verdict.sign(),
                    claim.verdict.words()
                );
            }
            body.push_str("</tbody>\n</table>\n");
        }
        for table in &self.tables {
            table.to_html(body);
        }
        body.push_str("</section>\n");
    }
}

impl PageTable {
    fn to_html(&self, body: &mut String) {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0).max(self.header.len());
        let cell = |row: &[String], i: usize| row.get(i).map_or(String::new(), |text| escape(text));
        // A column of numbers is right-aligned.
        let number =
            |text: &String| text.is_empty() || text.starts_with(|c: char| c.is_ascii_digit() || "-−+.–".contains(c));
        let numeric: Vec<bool> =
            (0..columns).map(|i| self.rows.iter().filter_map(|row| row.get(i)).all(number)).collect();
        let class = |i: usize| if numeric[i] { " class=\"number\"" } else { "" };
        body.push_str("<div class=\"scroll\"><table class=\"data\">\n");
        if !self.caption.is_empty() {
            let _ = writeln!(body, "<caption>{}</caption>", escape(&self.caption));
        }
        body.push_str("<thead><tr>");
        for i in 0..columns {
            let _ = write!(body, "<th{}>{}</th>", class(i), cell(&self.header, i));
        }
        body.push_str("</tr></thead>\n<tbody>\n");
        for row in &self.rows {
            body.push_str("<tr>");
            for i in 0..columns {
                let _ = write!(body, "<td{}>{}</td>", class(i), cell(row, i));
            }
            body.push_str("</tr>\n");
        }
        body.push_str("</tbody>\n</table></div>\n");
    }
}

fn paragraphs(body: &mut String, texts: &[String]) {
    for text in texts {
        let _ = writeln!(body, "<p>{}</p>", escape(text));
    }
}

fn dot(verdict: Verdict) -> String {
    format!("<span class=\"badge small {}\" title=\"{}\">{}</span> ", verdict.class(), verdict.words(), verdict.sign())
}

const STYLE: &str = "\
body { max-width: 1120px; padding: 2.5rem 1.5rem 4rem; }
h1 { font-size: 2rem; letter-spacing: -.01em; }
h2 { font-size: 1.35rem; line-height: 1.3; margin: 3rem 0 .75rem; padding-top: 1.25rem; border-top: 1px solid #ddd; overflow-wrap: anywhere; }
h3 { font-size: 1.05rem; margin: 1.25rem 0 0; text-align: center; overflow-wrap: anywhere; }
p { max-width: 46em; margin: .6rem 0; overflow-wrap: anywhere; }
a { color: #0060a0; }
nav ol { padding-left: 1.6rem; margin: 1rem 0; }
nav li { margin: .25rem 0; }
table { border-collapse: collapse; margin: 1rem 0; font-size: .95rem; }
th, td { text-align: left; vertical-align: top; padding: .5rem .75rem; border-bottom: 1px solid #e2e2e2; }
thead th { border-bottom: 2px solid #444; font-weight: 600; white-space: nowrap; }
caption { text-align: left; font-weight: 600; padding: .25rem 0 .5rem; }
table.claims { width: 100%; }
table.claims td:nth-child(1) { width: 44%; }
table.claims td:nth-child(3) { white-space: nowrap; }
table.data { font-variant-numeric: tabular-nums; }
.number { text-align: right; }
.scroll { overflow-x: auto; }
.summary { margin: 1.1rem 0; }
.badge { display: inline-block; padding: .1rem .6rem; margin: .1rem .15rem .1rem 0; border-radius: 1rem; border: 1px solid; font-size: .85rem; font-weight: 600; line-height: 1.5; -webkit-print-color-adjust: exact; print-color-adjust: exact; }
.badge.small { padding: 0 .4rem; margin: 0; font-size: .72rem; }
.badge.holds { color: #0b5a34; background: #e0f4e8; border-color: #8fd0ab; }
.badge.partly { color: #714b00; background: #fdf0d2; border-color: #e5c26c; }
.badge.fails { color: #8c1d13; background: #fce4e1; border-color: #e8a29a; }
@media screen and (prefers-color-scheme: dark) {
  h2 { border-color: #3a3f48; }
  a { color: #8ab8ff; }
  th, td { border-color: #343942; }
  thead th { border-color: #8a9099; }
  .badge.holds { color: #8fe3b4; background: #12362a; border-color: #2b7350; }
  .badge.partly { color: #f3d48a; background: #3b2f10; border-color: #8a6d25; }
  .badge.fails { color: #ffb3aa; background: #46201c; border-color: #96463d; }
}
@media (max-width: 720px) {
  body { padding: 1.25rem .9rem 3rem; }
  h1 { font-size: 1.5rem; }
  table.claims thead { display: none; }
  table.claims tr { display: block; border-bottom: 1px solid #bbb; padding: .6rem 0; }
  table.claims td, table.claims td:nth-child(1) { display: block; width: auto; border: 0; padding: .15rem 0; }
  table.claims td::before { content: attr(data-head) ': '; font-weight: 600; opacity: .75; }
}
@media print {
  body { padding: 0; max-width: none; font-size: 11pt; }
  nav { display: none; }
  .figure, table.claims tr, table.data tr { break-inside: avoid; }
  h2, h3, caption, section > p { break-after: avoid; }
}
";

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::samples;

    pub(crate) fn page() -> Page {
        let claim =
            |text: &str, measured: &str, verdict| Claim { text: text.into(), measured: measured.into(), verdict };
        let section = |dataset: stickslip_study::dataset::Dataset| Section {
            heading: dataset.title.clone(),
            paragraphs: vec![
                "Both blades vibrate; the contact slips near the resonance & sticks elsewhere <if at all>.".into(),
            ],
            figure: Some(dataset.figure),
            claims: vec![
                claim(
                    "The amplitude of the excited blade decreases with growing friction force.",
                    "peaks 4.98, 3.74, 2.99, 2.49 cm",
                    Verdict::Holds,
                ),
                claim(
                    "Both curves coincide below 120 Hz.",
                    "largest difference 0.4 % of the peak, at 119.9 Hz; 2 % at 120 Hz",
                    Verdict::HoldsWithQualification,
                ),
                claim("The resonance does not move.", "moves by 0.21 Hz from Ft = 2 N to 8 N", Verdict::DoesNotHold),
            ],
            tables: vec![PageTable {
                caption: "Peaks".into(),
                header: ["Ft (N)", "mass", "frequency (Hz)", "amplitude (cm)"].map(String::from).to_vec(),
                rows: vec![
                    ["2", "blade1", "120.95", "4.98"].map(String::from).to_vec(),
                    ["4", "blade1", "120.95", "3.74"].map(String::from).to_vec(),
                    vec!["6".into()],
                ],
            }],
        };
        Page {
            title: "Dry friction between blades: the paper's figures & claims".into(),
            introduction: vec![
                "Every figure of the paper, computed again and compared with the claims of its text.".into(),
            ],
            sections: vec![section(samples::hysteresis()), section(samples::response()), section(samples::hostile())],
        }
    }

    #[test]
    fn several_figures_share_one_script() {
        let html = page().to_html();
        assert_eq!(html.matches(&format!("<script src=\"{}\"", script_name())).count(), 1);
        for i in 1..=3 {
            assert!(
                html.contains(&format!("stickslip(\"figure-{i}\"")) && html.contains(&format!("id=\"section-{i}\""))
            );
        }
        assert!(html.len() < 500_000, "{}", html.len());
        assert!(html.contains("3 do not hold") && html.contains("sticks elsewhere &lt;if at all&gt;"));
        assert!(!html.contains("<script>alert"));
        let links = crate::figure::html::tests::markup(&html);
        assert_eq!(links.matches("href=").count(), links.matches("href=\"#section-").count());
        assert_eq!(links.matches("src=").count(), 1);
    }

    #[test]
    fn the_page_is_written_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = page().write(&folder.path().join("deep/report.html")).unwrap();
        assert_eq!(std::fs::read_to_string(path).unwrap(), page().to_html());
        assert_eq!(std::fs::read_to_string(folder.path().join("deep").join(script_name())).unwrap(), script());
        assert!(Page::default().to_html().contains("<h1></h1>"));
    }
}
