//! The other libraries: one adapter each, Embree's behind the feature `embree`, the others behind `peers`.
//!
//! An adapter converts the rays of hgrid to those of its library and the answers back, inside the measured
//! time: any user of the library has to do the same.

#[cfg(feature = "peers")]
mod bvh;
#[cfg(feature = "embree")]
mod embree;
#[cfg(feature = "peers")]
mod obvhs;
#[cfg(feature = "peers")]
mod parry;
#[cfg(feature = "peers")]
mod tinybvh;

use anyhow::Result;
use clap::ValueEnum;

use super::system::System;

/// A library and how it builds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Peer {
    /// Embree, build quality LOW (Morton codes)
    EmbreeLow,
    /// Embree, build quality LOW, a dynamic scene that is kept and committed again
    EmbreeDynamic,
    /// Embree, build quality MEDIUM (binned SAH)
    EmbreeMedium,
    /// Embree, build quality HIGH (SAH with spatial splits); only if it is named
    EmbreeHigh,
    /// Embree, build quality MEDIUM, scene flag ROBUST: no leaks at edges; only if it is named
    EmbreeRobust,
    /// Embree, build quality MEDIUM, scene flag COMPACT: less memory
    EmbreeCompact,
    /// Embree, build quality LOW, scene flag COMPACT
    EmbreeLowCompact,
    /// tinybvh, binned SAH, two-wide
    Tinybvh2,
    /// tinybvh, binned SAH, eight-wide
    Tinybvh8,
    /// tinybvh, SAH with spatial splits, eight-wide
    Tinybvh8Hq,
    /// obvhs, its preset for very fast builds, eight-wide
    ObvhsFast,
    /// obvhs, its preset for very slow builds, eight-wide
    ObvhsSlow,
    /// bvh, its only builder
    #[value(name = "bvh-crate")]
    Bvh,
    /// parry3d, binned
    ParryBinned,
    /// parry3d, PLOC
    ParryPloc,
}

impl Peer {
    /// Returns the name in commands and tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::EmbreeLow => "embree-low",
            Self::EmbreeDynamic => "embree-dynamic",
            Self::EmbreeMedium => "embree-medium",
            Self::EmbreeHigh => "embree-high",
            Self::EmbreeRobust => "embree-robust",
            Self::EmbreeCompact => "embree-compact",
            Self::EmbreeLowCompact => "embree-low-compact",
            Self::Tinybvh2 => "tinybvh2",
            Self::Tinybvh8 => "tinybvh8",
            Self::Tinybvh8Hq => "tinybvh8-hq",
            Self::ObvhsFast => "obvhs-fast",
            Self::ObvhsSlow => "obvhs-slow",
            Self::Bvh => "bvh-crate", // A method of hgrid is `bvh`.
            Self::ParryBinned => "parry-binned",
            Self::ParryPloc => "parry-ploc",
        }
    }

    /// Returns why this program lacks the peer and how to build one that has it; `None` if it has it.
    #[cfg(feature = "embree")]
    fn lack(self) -> Option<&'static str> {
        match self {
            Self::EmbreeLow
            | Self::EmbreeDynamic
            | Self::EmbreeMedium
            | Self::EmbreeHigh
            | Self::EmbreeRobust
            | Self::EmbreeCompact
            | Self::EmbreeLowCompact => None,
            _ if cfg!(not(feature = "peers")) => {
                Some("is not in this program: build it with --features peers, not embree")
            }
            // tinybvh-rs omits these layouts if the compiler may not use AVX2.
            Self::Tinybvh8 | Self::Tinybvh8Hq if cfg!(not(target_feature = "avx2")) => Some(
                "needs a program that may use AVX2: build it with RUSTFLAGS='-C target-cpu=native'",
            ),
            _ => None,
        }
    }

    #[cfg(feature = "embree")]
    fn system(self) -> Result<Box<dyn System>> {
        use embree::{Embree, Quality};
        if let Some(lack) = self.lack() {
            anyhow::bail!("{} {lack}", self.name());
        }
        Ok(match self {
            Self::EmbreeLow => Box::new(Embree::new(self, Quality::Low)?),
            Self::EmbreeDynamic => Box::new(Embree::new(self, Quality::Dynamic)?),
            Self::EmbreeMedium => Box::new(Embree::new(self, Quality::Medium)?),
            Self::EmbreeHigh => Box::new(Embree::new(self, Quality::High)?),
            Self::EmbreeRobust => Box::new(Embree::new(self, Quality::Robust)?),
            Self::EmbreeCompact => Box::new(Embree::new(self, Quality::Compact)?),
            Self::EmbreeLowCompact => Box::new(Embree::new(self, Quality::LowCompact)?),
            #[cfg(feature = "peers")]
            Self::Tinybvh2 => Box::new(tinybvh::Tinybvh2(self)),
            #[cfg(all(feature = "peers", target_feature = "avx2"))]
            Self::Tinybvh8 => Box::new(tinybvh::Tinybvh8 { peer: self, is_hq: false }),
            #[cfg(all(feature = "peers", target_feature = "avx2"))]
            Self::Tinybvh8Hq => Box::new(tinybvh::Tinybvh8 { peer: self, is_hq: true }),
            #[cfg(feature = "peers")]
            Self::ObvhsFast => Box::new(obvhs::Obvhs::fast(self)),
            #[cfg(feature = "peers")]
            Self::ObvhsSlow => Box::new(obvhs::Obvhs::slow(self)),
            #[cfg(feature = "peers")]
            Self::Bvh => Box::new(bvh::BvhSystem(self)),
            #[cfg(feature = "peers")]
            Self::ParryBinned => Box::new(parry::Parry::binned(self)),
            #[cfg(feature = "peers")]
            Self::ParryPloc => Box::new(parry::Parry::ploc(self)),
            #[cfg(not(all(feature = "peers", target_feature = "avx2")))]
            _ => anyhow::bail!("{} is not in this program", self.name()),
        })
    }
}

/// Starts a system for each peer. If none is named, starts all that this program has, except for `embree-high` and
/// `embree-robust`, which no row of ratios needs.
///
/// # Errors
/// If this program lacks one of the peers, or a library does not start.
#[cfg(feature = "embree")]
pub fn systems(peers: &[Peer]) -> Result<Vec<Box<dyn System>>> {
    let is_usual = |peer: &Peer| {
        peer.lack().is_none() && !matches!(peer, Peer::EmbreeHigh | Peer::EmbreeRobust)
    };
    let usual = Peer::value_variants().iter().copied().filter(is_usual);
    let peers = if peers.is_empty() { usual.collect() } else { peers.to_vec() };
    peers.into_iter().map(Peer::system).collect()
}

/// Fails: without the feature there is no peer.
///
/// # Errors
/// Always; the message says how to build a program that has them.
#[cfg(not(feature = "embree"))]
pub fn systems(_: &[Peer]) -> Result<Vec<Box<dyn System>>> {
    anyhow::bail!(
        "this program was built without the other ray tracers (`hgrid table` measures without them). On \
         Debian: apt-get install libembree-dev g++, then RUSTFLAGS='-C target-cpu=native' \
         cargo run --release -p hgrid-lab --features peers -- compare ... \
         (with --features embree for Embree alone, which needs no C++ compiler)"
    )
}

#[cfg(test)]
mod tests {
    use hgrid_core::Method;

    use super::*;

    #[test]
    fn names_are_those_of_the_command_line_and_of_no_method() {
        for peer in Peer::value_variants() {
            assert_eq!(peer.to_possible_value().unwrap().get_name(), peer.name());
            // First builds find their system by name, so no peer may have the name of a method.
            let is_method = |method: &Method| method.name() == peer.name();
            assert!(!Method::ALL.iter().any(is_method), "{peer:?}");
        }
    }

    #[cfg(not(feature = "embree"))]
    #[test]
    fn without_the_peers_the_error_says_how_to_get_them() {
        let error = systems(&[]).map(|_| ()).unwrap_err().to_string();
        for words in ["--features peers", "libembree-dev", "cargo run --release -p hgrid-lab"] {
            assert!(error.contains(words), "{error}");
        }
        assert_eq!(error.lines().count(), 1);
    }
}
