//! Elements as text: one in a line, its numbers between blanks.
//!
//! Numbers are those of Rust, so that what C and Python write is read: `nan`, `-inf`, `1.` and `.5`, too. Whether a
//! number is one of its declared type is not checked.

use anyhow::{Context as _, Result};
use ply_rs_bw::ply::{BeginList, ElementDef, PropertyAccess, PropertyType, ScalarType};

use crate::scene::quoted;

/// Reads the line of an element.
///
/// # Errors
/// If a number is missing or is none.
pub(super) fn read<E: PropertyAccess>(line: &str, element: &ElementDef) -> Result<E> {
    let mut words = line.split_ascii_whitespace();
    let mut value = E::new();
    for (name, property) in &element.properties {
        let mut word = || words.next().with_context(|| format!("the line ends before `{name}`"));
        match property.data_type {
            PropertyType::Scalar(ScalarType::Float) => {
                value.set_float(name, number(word()?)?);
            }
            PropertyType::Scalar(_) => {
                value.set_double(name, number(word()?)?);
            }
            PropertyType::List(..) => {
                let count: usize = number(word()?)?;
                match value.begin_list_int(name, count) {
                    BeginList::Fill(list) => {
                        for _ in 0..count {
                            list.push(number(word()?)?);
                        }
                    }
                    _ => {
                        for _ in 0..count {
                            word()?;
                        }
                    }
                }
            }
        }
    }
    Ok(value)
}

fn number<T: core::str::FromStr>(word: &str) -> Result<T> {
    word.parse().ok().with_context(|| format!("{} is no number that fits here", quoted(word)))
}
