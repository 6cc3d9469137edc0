//! Sizes and colours of a static figure.

/// Text sizes in px. A figure with two columns, printed 170 mm wide, has tick labels of 6 to 7
/// pt.
pub(super) const TITLE: f64 = 18.0;
pub(super) const PANEL_TITLE: f64 = 15.0;
pub(super) const LABEL: f64 = 15.0;
pub(super) const TICK: f64 = 13.5;
/// Line height relative to the text size.
pub(super) const LEADING: f64 = 1.3;
/// Outer margin of the figure and space between panels, in px.
pub(super) const MARGIN: f64 = 16.0;
pub(super) const GAP: f64 = 26.0;
pub(super) const TICK_LENGTH: f64 = 5.0;
pub(super) const MINOR_LENGTH: f64 = 3.0;
pub(super) const LINE: f64 = 1.8;
pub(super) const MARK: f64 = 3.8;
/// Width of the colour bar.
pub(super) const COLOUR_BAR_WIDTH: f64 = 16.0;
pub(super) const TEXT: &str = "#1a1a1a";
pub(super) const AXIS: &str = "#444444";
pub(super) const GRID: &str = "#e3e3e3";
pub(super) const FINE_GRID: &str = "#f2f2f2";
