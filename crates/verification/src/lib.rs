//! Tests of Stickslip against closed forms, published results and outside integrators; see `tests/`.
