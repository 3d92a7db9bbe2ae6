//! Milling in three directions: how deep may this cutter go before it chatters?

pub mod model;
