//! What a network is like, and what in it carries no load.
