//! Panels of contact states: the shares of the period in which the faces of joints stick, slip,
//! touch and are apart.
//!
//! A few joints have stacked areas; a ring has a map with a stripe for every joint.

use crate::results::columns;
use crate::results::dataset::{Axis, Panel, Series, Style, Table};
use crate::results::drawing::numbers;
use std::ops::Range;
use stickslip::orbit::Contact;

/// Up to this number of joints, each joint has one panel.
const MAX_SINGLE: usize = 3;
/// Factor from shares to percent.
const PERCENT: f64 = 100.0;

/// The contact state of faces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::kinds) enum ContactState {
    Stick,
    Slip,
    /// A stop in contact, whose sliding is unknown.
    Touch,
    Open,
}

impl ContactState {
    const ALL: [ContactState; 4] = [ContactState::Stick, ContactState::Slip, ContactState::Touch, ContactState::Open];

    /// Returns the state as a panel names it.
    pub(in crate::kinds) fn words(self) -> &'static str {
        match self {
            ContactState::Stick => "sticks",
            ContactState::Slip => "slips",
            ContactState::Touch => "touches",
            ContactState::Open => "is apart",
        }
    }
}

/// Returns true if a table has the shares of a joint.
pub(in crate::kinds) fn has(table: &Table, joint: &str) -> bool {
    table.numbers(&columns::stick_fraction(joint)).is_some_and(|shares| shares.iter().any(|share| share.is_finite()))
}

/// Returns the shares in percent of the period, in the order of [`ContactState::ALL`], row by row.
fn state_shares(table: &Table, joint: &str, rows: &Range<usize>) -> [Vec<f64>; 4] {
    let [stick, slip, open] =
        [columns::stick_fraction(joint), columns::slip_fraction(joint), columns::open_fraction(joint)]
            .map(|column| numbers(table, &column, rows.clone()));
    // the remainder is contact of a stop
    let touch = (0..stick.len()).map(|i| 1.0 - stick[i] - slip[i] - open[i]);
    // Shares below this are rounding.
    let touch = touch.map(|share| if share.abs() < 1e-9 { 0.0 } else { share }).collect();
    [stick, slip, touch, open].map(|shares: Vec<f64>| shares.into_iter().map(|share| share * PERCENT).collect())
}

/// Returns the axis of a share, which is also the colour scale.
pub(in crate::kinds) fn axis(quantity: &str) -> Axis {
    Axis::new(quantity, "%").with_range(0.0, PERCENT)
}

/// Returns the share of the period of one state, in percent; the mean of several joints.
pub(in crate::kinds) fn mean_share(
    table: &Table,
    joints: &[String],
    rows: &Range<usize>,
    state: ContactState,
) -> Vec<f64> {
    let all: Vec<Vec<f64>> =
        joints.iter().map(|joint| state_shares(table, joint, rows)[state as usize].clone()).collect();
    (0..rows.len()).map(|i| all.iter().map(|shares| shares[i]).sum::<f64>() / all.len() as f64).collect()
}

/// Returns true if one of the joints is ever in a state.
pub(in crate::kinds) fn occurs_in(table: &Table, joints: &[String], state: ContactState) -> bool {
    joints.iter().any(|joint| occurs(&state_shares(table, joint, &(0..table.rows()))[state as usize]))
}

/// Returns the states with a map. Stick has no map, because it is the remainder.
fn map_states(table: &Table, joints: &[String]) -> Vec<ContactState> {
    let drawn = |state: &ContactState| match state {
        ContactState::Stick => false,
        ContactState::Slip => true,
        ContactState::Touch | ContactState::Open => occurs_in(table, joints, *state),
    };
    ContactState::ALL.into_iter().filter(drawn).collect()
}

/// Returns the number of panels that [`panels`] returns.
pub(in crate::kinds) fn count(table: &Table, joints: &[String]) -> usize {
    if joints.len() <= MAX_SINGLE { joints.len() } else { map_states(table, joints).len() }
}

/// Groups joints for panels of one quantity: each of a few joints, or all together.
pub(in crate::kinds) fn groups(joints: &[String]) -> Vec<(String, Vec<String>)> {
    match joints.len() {
        0..=MAX_SINGLE => joints.iter().map(|joint| (joint.clone(), vec![joint.clone()])).collect(),
        many => vec![(format!("mean of {many} joints"), joints.to_vec())],
    }
}

/// The drawing of the panels of contact states.
pub(in crate::kinds) struct SharePlot<'a> {
    /// Abscissae of the rows, and their axis.
    pub(in crate::kinds) x: &'a [f64],
    pub(in crate::kinds) axis: &'a Axis,
    pub(in crate::kinds) title: &'a str,
    /// Number of the first colour; the panels of a few joints share their colours.
    pub(in crate::kinds) first_colour: usize,
}

/// Returns the panels of some rows.
pub(in crate::kinds) fn panels(
    table: &Table,
    joints: &[String],
    rows: &Range<usize>,
    plot: &SharePlot<'_>,
) -> Vec<Panel> {
    let SharePlot { x, axis: over, title, first_colour } = *plot;
    let all: Vec<[Vec<f64>; 4]> = joints.iter().map(|joint| state_shares(table, joint, rows)).collect();
    let titled = |words: &str| if title.is_empty() { words.to_owned() } else { format!("{words}, {title}") };
    if joints.len() <= MAX_SINGLE {
        let occurring: Vec<ContactState> =
            ContactState::ALL.into_iter().filter(|state| occurs_in(table, joints, *state)).collect();
        let joint_panel = |(joint, shares): (&String, &[Vec<f64>; 4])| Panel {
            title: titled(joint),
            x: over.clone(),
            y: axis("share of the period"),
            series: areas(shares, x, &occurring, first_colour),
            ..Panel::default()
        };
        return joints.iter().zip(&all).map(joint_panel).collect();
    }
    let names = Axis { names: joints.to_vec(), ..Axis::new("joint", "").with_range(-0.5, joints.len() as f64 - 0.5) };
    let map = |state: ContactState| Panel {
        title: titled(&format!("share of the period in which a joint {}", state.words())),
        x: over.clone(),
        y: names.clone(),
        series: all
            .iter()
            .enumerate()
            .map(|(j, shares)| Series::stripe(x.to_vec(), j as f64, shares[state as usize].clone()))
            .collect(),
        ..Panel::default()
    };
    map_states(table, joints).into_iter().map(map).collect()
}

fn occurs(shares: &[f64]) -> bool {
    shares.iter().any(|share| *share > 0.0)
}

/// Returns the stacked shares of one joint, coloured by the states that occur in any joint.
fn areas(shares: &[Vec<f64>; 4], x: &[f64], occurring: &[ContactState], first: usize) -> Vec<Series> {
    let mut below = vec![0.0; x.len()];
    let mut areas = Vec::new();
    for (colour, state) in (first..).zip(occurring) {
        let shares = &shares[*state as usize];
        if occurs(shares) {
            let above: Vec<f64> = below.iter().zip(shares).map(|(below, share)| below + share).collect();
            areas.push(Series::band(state.words(), x.to_vec(), below, above.clone(), colour));
            areas.push(Series { style: Style::Solid, ..Series::line("", x.to_vec(), above.clone(), colour) });
            below = above;
        }
    }
    // the upper edge of the last area is the edge of the panel
    areas.pop();
    areas
}

/// Returns the word of a contact state in tables.
pub(in crate::kinds) fn contact_word(contact: Contact) -> &'static str {
    match contact {
        Contact::Stick => "stick",
        Contact::SlipForward => "slip+",
        Contact::SlipBackward => "slip-",
        Contact::Slip => "slip",
        Contact::Touch => "touch",
        Contact::Open => "open",
    }
}
