//! Why an effect that the search found is not named.
//!
//! Not physics: reasons in words.

use std::collections::BTreeMap;

/// What speaks against an effect.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    Wander,
    OwnPath,
    Pile,
    SlowStars,
    StarConstants,
    StandIn,
    /// With this variable.
    Change(String),
    Remainder,
    Described,
    NoLessError,
    Fallen,
}

/// What was refused, by family ([`crate::search::family`]).
pub(crate) type Refused = BTreeMap<String, Refusal>;

/// Whether any of them follows a path that holds the error which it would explain.
pub(crate) fn for_own_path(refused: &Refused) -> bool {
    refused.values().any(|why| *why == Refusal::OwnPath)
}

impl Refusal {
    /// In the words of the report.
    pub(crate) fn why(&self) -> String {
        let why = match self {
            Self::Wander => "a slow error of the reference is the likelier explanation",
            Self::OwnPath => "the slow error of the reference makes as much of its own path",
            Self::Pile => {
                "more stars would be misplaced than a catalogue has: something moves them all"
            }
            Self::SlowStars => "slow noise of the stars makes as much",
            Self::StarConstants => "stars err by constants of their own, of which it is a part",
            Self::StandIn => "what the residual follows explains the same and more",
            Self::Change(variable) => {
                return format!("it is not the same everywhere, but changes with {variable}");
            }
            Self::Remainder => "it is next to nothing beside what no effect explains",
            Self::Described => "it does not stand beside what the residual follows",
            Self::NoLessError => "the error out of fold is no smaller with it",
            Self::Fallen => "it does not stand beside what was added after it",
        };
        why.to_owned()
    }
}
