//! What an operation demands of its caller.

use crate::model::Scope;

/// See the variants; [`auth`](super::auth) enforces it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Nothing, not even one of the service's names: whether the process lives. Not logged.
    Probe,
    /// Nothing: pages and the API's description.
    Public,
    /// A key of this scope or a greater one, where keys are on.
    Needs(Scope),
    /// A key of scope `admin`; while there is no key, the local token. For what can hand the service over to another owner.
    Owner,
}

impl Access {
    /// The scope a key needs; `None` where no key is needed.
    pub fn scope(self) -> Option<Scope> {
        match self {
            Self::Probe | Self::Public => None,
            Self::Needs(scope) => Some(scope),
            Self::Owner => Some(Scope::Admin),
        }
    }
}
