//! Expressions of a text: its words and signs, and the operations in the order in which they are done.

mod lexer;
mod operation;
mod parser;

pub(super) use lexer::{Problem, is_name};
pub(super) use operation::{Binary, Callable, OnOne, OnTwo, Unary};
pub(super) use parser::{Expression, Item};
