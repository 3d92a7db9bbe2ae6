//! Machines, tools and materials by name.
//!
//! Pure: no I/O, no clock, no HTTP, no sentence. A record is JSON of one of four kinds, declared field by field in
//! [`record`]; the built-in ones are in [`built_in`]. [`asked()`] says which names a job uses, [`resolve()`] writes what
//! their records say into it, with the origin of every number. What ISO codes say is [`iso`], how a name is found
//! [`search`].

pub mod built_in;
pub mod iso;
pub mod kienzle;
pub mod life;
pub mod record;
pub mod resolve;
pub mod search;

pub use record::{Kind, Record};
pub use resolve::{Asked, Lookup, Resolution, Resource, asked, resolve};
