//! The interface of a law: the trait [`Law`], its views, and the types that they use.
//!
//! - `law_trait`: the trait of all laws, and the description of a law in the table.
//! - `parameter`: parameters, their ranges, and the errors of invalid values.
//! - `relative_motion`: the relative motion of the two faces of a joint.
//! - `contact`: contact states.
//! - `ideal_elements`, `rate`, `step`, `masing`, `sliding`, `prox`: the views, one file each.
//! - `derivatives`: memory for the derivatives of the rate view and the step view.
//! - `describing_function`: the first harmonic of any law, from its views.

mod contact;
mod derivatives;
pub(in crate::law) mod describing_function;
pub(in crate::law) mod ideal_elements;
mod law_trait;
pub(in crate::law) mod masing;
pub(in crate::law) mod parameter;
pub(super) mod prox;
mod rate;
mod relative_motion;
mod sliding;
mod step;

pub use contact::Contact;
pub use ideal_elements::{IdealElement, Slider};
pub use law_trait::{Law, LawInfo, SharedLaw};
pub use masing::MasingView;
pub use parameter::{BuildError, LawError, Parameter, Range, TANGENTS};
pub use prox::{ProxView, SampleMeans};
pub use rate::{RateLaw, RatePoint, RateView};
pub use relative_motion::{MAX_DIRECTIONS, RelativeMotion};
pub use sliding::SlidingView;
pub use step::{DisplacementBox, StepDerivatives, StepLaw, StepPoint, StepView};
