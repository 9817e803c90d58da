//! Ways to hand rays to a structure.

use serde::{Serialize, Serializer};

/// A way to hand rays over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// One ray a call.
    Single,
    /// Some hundred rays a call, neighbours next to each other.
    Coherent,
    /// All rays of a workload in one call, without a hint about their order.
    Batch,
    /// A packet a call: several rays, stored axis by axis.
    Packet(Lanes, Hint),
    /// Many rays a call, one after the other in memory.
    Stream(Hint),
}

/// Rays in a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lanes {
    /// The lanes of a register of SSE.
    Four,
    /// The lanes of a register of AVX.
    Eight,
    /// The lanes of a register of AVX-512.
    Sixteen,
}

/// The caller's hint about the rays of a call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hint {
    /// Nothing.
    None,
    /// The rays are coherent.
    Coherent,
}

impl Mode {
    /// The word that tables use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        use Hint::{Coherent, None};
        match self {
            Self::Single => "single",
            Self::Coherent => "coherent",
            Self::Batch => "batch",
            Self::Packet(Lanes::Four, None) => "packet4",
            Self::Packet(Lanes::Eight, None) => "packet8",
            Self::Packet(Lanes::Sixteen, None) => "packet16",
            Self::Packet(Lanes::Four, Coherent) => "packet4-coherent",
            Self::Packet(Lanes::Eight, Coherent) => "packet8-coherent",
            Self::Packet(Lanes::Sixteen, Coherent) => "packet16-coherent",
            Self::Stream(None) => "stream",
            Self::Stream(Coherent) => "stream-coherent",
        }
    }
}

impl Serialize for Mode {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}
