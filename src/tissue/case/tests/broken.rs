//! Broken files and the exact words a user gets.
