//! Expressions: a text becomes its operations in the order in which they are done.

use super::lexer::{Problem, Token, tokens};
use super::operation::{Binary, Callable, FUNCTIONS, Unary};
use crate::setting::{count, did_you_mean, number};

/// Longest expression, in bytes: some thousand operations.
const LONGEST: usize = 20_000;
/// Deepest nesting of brackets, signs and powers: far beyond what people write, far within the stack of a thread.
const DEEPEST: usize = 100;

/// An operation on numbers that stand before it.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::equations) enum Item {
    Number(f64),
    /// A name, at a byte of the text.
    Name(String, usize),
    One(Unary),
    Two(Binary),
    If,
}

/// An expression, operands before their operation.
#[derive(Debug, Clone, PartialEq, Default)]
pub(in crate::equations) struct Expression(pub Vec<Item>);

impl Expression {
    /// A number.
    pub fn number(value: f64) -> Self {
        Self(vec![Item::Number(value)])
    }

    /// Parses a text; an error has the byte.
    pub fn parse(text: &str) -> Result<Self, Problem> {
        if text.len() > LONGEST {
            return Err((
                0,
                format!("an expression of more than {LONGEST} bytes; define parts of it"),
            ));
        }
        let tokens = tokens(text)?;
        let mut parser = Parser {
            tokens: &tokens,
            items: vec![],
            depth: 0,
        };
        parser.expression(0)?;
        match parser.tokens[0] {
            (_, Token::End) => Ok(Self(parser.items)),
            (at, token) => Err((at, unexpected(token, "an operation"))),
        }
    }

    /// Scope with their bytes.
    pub fn names(&self) -> impl Iterator<Item = (&str, usize)> {
        self.0.iter().filter_map(|item| match item {
            Item::Name(name, at) => Some((name.as_str(), *at)),
            _ => None,
        })
    }
}

struct Parser<'t> {
    tokens: &'t [(usize, Token<'t>)],
    items: Vec<Item>,
    depth: usize,
}

/// Strength of `not`, between `and` and comparisons.
const NOT: u8 = 5;
/// Strength of a sign: below that of a power, so that -x^2 is -(x^2).
const SIGN: u8 = 13;

/// Operation between two numbers: strength to the left and to the right, and whether the numbers are exchanged.
fn between(token: Token<'_>) -> Option<(Binary, u8, u8, bool)> {
    let word = match token {
        Token::Name(word) | Token::Sign(word) => word,
        _ => return None,
    };
    Some(match word {
        "or" => (Binary::Or, 1, 2, false),
        "and" => (Binary::And, 3, 4, false),
        "<" => (Binary::Less, COMPARED, COMPARED + 1, false),
        "<=" => (Binary::LessEqual, COMPARED, COMPARED + 1, false),
        ">" => (Binary::Less, COMPARED, COMPARED + 1, true),
        ">=" => (Binary::LessEqual, COMPARED, COMPARED + 1, true),
        "==" => (Binary::Equal, COMPARED, COMPARED + 1, false),
        "!=" => (Binary::NotEqual, COMPARED, COMPARED + 1, false),
        "+" => (Binary::Add, 9, 10, false),
        "-" => (Binary::Sub, 9, 10, false),
        "*" => (Binary::Mul, 11, 12, false),
        "/" => (Binary::Div, 11, 12, false),
        "^" => (Binary::Pow, 15, 14, false),
        _ => return None,
    })
}

/// Strength of comparisons.
const COMPARED: u8 = 7;

impl<'t> Parser<'t> {
    /// Returns the next token and goes on; the end stays.
    fn next(&mut self) -> (usize, Token<'t>) {
        let token = self.tokens[0];
        if token.1 != Token::End {
            self.tokens = &self.tokens[1..];
        }
        token
    }

    /// Takes a sign if it is next.
    fn takes(&mut self, sign: &str) -> bool {
        let is_next = matches!(self.tokens[0].1, Token::Sign(next) if next == sign);
        if is_next {
            self.next();
        }
        is_next
    }

    /// Parses what binds at least so strongly.
    fn expression(&mut self, least: u8) -> Result<(), Problem> {
        self.depth += 1;
        if self.depth > DEEPEST {
            let problem = format!("nested more than {DEEPEST} deep; define parts of it");
            return Err((self.tokens[0].0, problem));
        }
        self.operand()?;
        let mut is_compared = false;
        loop {
            let (at, token) = self.tokens[0];
            if let Some(problem) = foreign(token, self.tokens.get(1).map(|next| next.1)) {
                return Err((at, problem.into()));
            }
            let Some((operation, left, right, is_exchanged)) = between(token) else {
                break;
            };
            if left < least {
                break;
            }
            if left == COMPARED && std::mem::replace(&mut is_compared, true) {
                return Err((at, "a second comparison; write a < b and b < c".into()));
            }
            self.next();
            let first = self.items.len();
            self.expression(right)?;
            if is_exchanged {
                // a > b is b < a: the right side is moved before the left one.
                let start = self.start_before(first);
                self.items[start..].rotate_left(first - start);
            }
            self.items.push(Item::Two(operation));
        }
        self.depth -= 1;
        Ok(())
    }

    /// Index at which the operand begins that ends before `end`.
    fn start_before(&self, end: usize) -> usize {
        let (mut needed, mut at) = (1, end);
        while needed > 0 {
            at -= 1;
            needed += match self.items[at] {
                Item::Number(_) | Item::Name(..) => 0,
                Item::One(_) => 1,
                Item::Two(_) => 2,
                Item::If => 3,
            };
            needed -= 1;
        }
        at
    }

    fn operand(&mut self) -> Result<(), Problem> {
        match self.next() {
            (_, Token::Number(value)) => self.items.push(Item::Number(value)),
            (_, Token::Name("not")) => {
                self.expression(NOT)?;
                self.items.push(Item::One(Unary::Not));
            }
            (_, Token::Sign("-")) => {
                self.expression(SIGN)?;
                self.items.push(Item::One(Unary::Neg));
            }
            (_, Token::Sign("+")) => self.expression(SIGN)?,
            (_, Token::Sign("(")) => {
                self.expression(0)?;
                self.close()?;
            }
            (at, Token::Name(name)) if !matches!(name, "and" | "or") => match self.takes("(") {
                true => self.call(name, at)?,
                false => match Callable::named(name) {
                    Some(_) => {
                        return Err((at, format!("{name} is a function; write {name}(…)")));
                    }
                    None => self.items.push(Item::Name(name.into(), at)),
                },
            },
            (at, token) => return Err((at, unexpected(token, "a number or a name"))),
        }
        Ok(())
    }

    fn close(&mut self) -> Result<(), Problem> {
        let (at, token) = self.tokens[0];
        match self.takes(")") {
            true => Ok(()),
            false => Err((at, unexpected(token, "an operation or )"))),
        }
    }

    /// Parses the numbers that a function takes, up to its bracket.
    fn call(&mut self, name: &str, at: usize) -> Result<(), Problem> {
        let function = Callable::named(name).ok_or_else(|| {
            let near = did_you_mean(name, FUNCTIONS.map(|(name, _)| name));
            let known = FUNCTIONS.map(|(name, _)| name).join(", ");
            (
                at,
                format!("unknown function \"{name}\"{near}; there are {known}"),
            )
        })?;
        let mut given = 0;
        if !self.takes(")") {
            loop {
                self.expression(0)?;
                given += 1;
                // What takes several does them from the left.
                match function {
                    Callable::Several(operation) if given > 1 => {
                        self.items.push(Item::Two(operation));
                    }
                    Callable::Clamp if given == 2 => self.items.push(Item::Two(Binary::Max)),
                    Callable::Clamp if given == 3 => self.items.push(Item::Two(Binary::Min)),
                    _ => {}
                }
                if !self.takes(",") {
                    break;
                }
            }
            self.close()?;
        }
        let (least, most) = function.arity();
        if !(least..=most).contains(&given) {
            let needed = match most {
                usize::MAX => format!("{least} or more"),
                _ => least.to_string(),
            };
            let given = count(given, "number");
            return Err((at, format!("{name} has {given}; it takes {needed}")));
        }
        match function {
            Callable::One(operation) => self.items.push(Item::One(operation)),
            Callable::Two(operation) => self.items.push(Item::Two(operation)),
            Callable::If => self.items.push(Item::If),
            Callable::Several(_) | Callable::Clamp => {}
        }
        Ok(())
    }
}

/// Says how an operation of other languages is written here.
fn foreign(token: Token<'_>, next: Option<Token<'_>>) -> Option<&'static str> {
    match (token, next) {
        (Token::Sign("="), Some(Token::Sign(">"))) => Some("=>; write >= to compare"),
        (Token::Sign("="), Some(Token::Sign("<"))) => Some("=<; write <= to compare"),
        (Token::Sign("="), _) => Some("a single =; write == to compare"),
        (Token::Sign("*"), Some(Token::Sign("*"))) => Some("**; write ^ for a power"),
        _ => None,
    }
}

fn unexpected(token: Token<'_>, expected: &str) -> String {
    let found = match token {
        Token::End => {
            return format!(
                "the expression ends where {expected} is expected; write one behind it"
            );
        }
        Token::Number(given) => format!("unexpected {}", number(given)),
        Token::Name(word) => format!("unexpected \"{word}\""),
        Token::Sign(sign) => format!("unexpected \"{sign}\""),
    };
    format!("{found} where {expected} is expected; write one before it")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Value of an expression of numbers alone.
    fn value(text: &str) -> f64 {
        let mut stack: Vec<f64> = vec![];
        for item in Expression::parse(text).unwrap().0 {
            let mut pop = || stack.pop().unwrap();
            let value = match item {
                Item::Number(value) => value,
                Item::Name(name, _) => panic!("{name}"),
                Item::One(operation) => operation.value(pop()),
                Item::Two(operation) => {
                    let b = pop();
                    operation.value(pop(), b)
                }
                Item::If => {
                    let (b, a, c) = (pop(), pop(), pop());
                    if c != 0.0 { a } else { b }
                }
            };
            stack.push(value);
        }
        assert_eq!(stack.len(), 1);
        stack[0]
    }

    #[test]
    fn operations_bind_as_in_mathematics() {
        for (text, expected) in [
            ("1 + 2*3", 7.0),
            ("-2^2", -4.0),
            ("2^-1", 0.5),
            ("2^3^2", 512.0),
            ("8/4/2", 1.0),
            ("1 - 2 - 3", -4.0),
            ("-2*-3", 6.0),
            ("3 > 2", 1.0),
            ("1 + 1 >= 3", 0.0),
            ("2 <= 2 and not 1 > 2", 1.0),
            ("0 and 1 or 1", 1.0),
            ("not 0 == 1", 1.0),
            ("if(2*3 > 1 + 4, 10, 20)", 10.0),
            ("max(1, 7, 3) - min(4, 2)", 5.0),
            ("clamp(5, 0, 2) + clamp(-5, 0, 2)", 2.0),
            ("mod(-1, 3)", 2.0),
            ("sign(-3) + sign(0)", -1.0),
            ("atan2(0, 1) + abs(-2)", 2.0),
            ("(5 - 7) > (2 - 9)", 1.0),
        ] {
            assert_eq!(value(text), expected, "{text}");
        }
    }

    #[test]
    fn problems_have_their_place() {
        for (text, at, part) in [
            ("1 + ", 4, "the expression ends"),
            ("(1 + 2", 6, "an operation or )"),
            ("1 2", 2, "unexpected 2"),
            ("sine(1)", 0, "did you mean \"sin\"?"),
            ("1 + atan2(1)", 4, "atan2 has 1 number; it takes 2"),
            ("min(1)", 0, "2 or more"),
            ("sin + 1", 0, "write sin("),
            ("1 < 2 < 3", 6, "second comparison"),
            ("1 = 2", 2, "write =="),
            ("1 => 2", 2, "write >="),
            ("1 =< 2", 2, "write <="),
            ("and 1", 0, "unexpected \"and\""),
            ("2 ** 3", 2, "write ^"),
        ] {
            let (byte, problem) = Expression::parse(text).unwrap_err();
            assert!(problem.contains(part), "{text}: {problem}");
            assert_eq!(byte, at, "{text}");
        }
    }

    #[test]
    fn depth_and_length_are_limited() {
        for text in [
            "(".repeat(5000),
            "-".repeat(5000),
            "2^".repeat(5000),
            "1+".repeat(15_000),
        ] {
            assert!(Expression::parse(&text).is_err());
        }
        assert_eq!(value(&format!("1{}", "+1".repeat(5000))), 5001.0);
    }
}
