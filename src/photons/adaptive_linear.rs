//! `adaptive-linear`: as `adaptive`, with forecasts of first order, as the paper has them.

use super::adaptive::emission;
use super::emit::{EmissionContext, EmissionEntry, PhotonSource};
use crate::geometry::forecast::Order;

fn build<'a>(cx: &EmissionContext<'a>) -> Box<dyn PhotonSource + 'a> {
    emission(cx, Order::Linear)
}

/// The table's line.
pub(super) const ENTRY: EmissionEntry = EmissionEntry {
    name: "adaptive-linear",
    doc: "as adaptive, with the paper's linear forecasts: to measure what the second order brings",
    build,
};
