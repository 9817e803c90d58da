//! The C library is what its header says.
//!
//! The tests generate the header from the sources and compare it; they compile it alone in every dialect;
//! they pin its numbers; C programs, which are also C++, use the library by its header alone; and the
//! libraries' symbols show that nothing else is in them; a debug build stops at mistakes.

mod answers;
mod cases;
mod create;
mod header;
mod left_out;
mod misuse;
mod programs;
mod promises;
mod symbols;
