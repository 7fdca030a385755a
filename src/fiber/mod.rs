//! The micro scale: fiber networks as representative volume elements (RVEs), generic over the linear-algebra backend.

pub mod law;
pub mod network;
