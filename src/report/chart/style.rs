//! Colour, width and dashes of lines.

/// Style of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Style {
    /// A colour of SVG.
    pub colour: &'static str,
    /// In user units.
    pub width: f64,
    /// Lengths of dashes and gaps; empty for an unbroken line.
    pub dash: &'static str,
}

impl Style {
    /// A measured record: broad and pale, so that what is laid over it can be seen.
    pub const RECORD: Self = Self::new("#a6a6a6", 3.0, "");
    /// The old state.
    pub const BEFORE: Self = Self::new("#d55e00", 1.5, "6 4");
    /// The new state.
    pub const AFTER: Self = Self::new("#0072b2", 1.5, "");
    /// The line that marks zero.
    pub const ZERO: Self = Self::new("#555555", 1.0, "");
    /// For anything else, in this order.
    pub const OTHERS: [Self; 5] = [
        Self::AFTER,
        Self::BEFORE,
        Self::new("#009e73", 1.5, "2 3"),
        Self::new("#cc79a7", 1.5, "10 3 2 3"),
        Self::new("#222222", 1.5, "4 2"),
    ];

    const fn new(colour: &'static str, width: f64, dash: &'static str) -> Self {
        Self {
            colour,
            width,
            dash,
        }
    }

    pub(super) fn stroke(self) -> String {
        let dash = match self.dash {
            "" => String::new(),
            dash => format!(r#" stroke-dasharray="{dash}""#),
        };
        format!(
            r#"stroke="{}" stroke-width="{}"{dash}"#,
            self.colour, self.width
        )
    }
}
