//! Is the C library what its header says?
//!
//! The header is made from the sources and compared; it is compiled alone in every dialect; its
//! numbers are pinned; C programs, which are also C++, use the library as a stranger would; and the
//! libraries' symbols show that there is nothing else in them.

mod answers;
mod cases;
mod create;
mod header;
mod left_out;
mod programs;
mod promises;
mod symbols;
