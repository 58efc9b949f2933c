//! Closed intervals and axis-aligned rectangles, for bounds that must be true bounds.

use std::ops::{Add, Mul, Neg, Sub};

use glam::DVec2;

/// A closed interval `[min, max]`; empty when `min > max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub min: f64,
    /// Upper end.
    pub max: f64,
}

impl Interval {
    /// The interval `[min, max]`.
    pub const fn new(min: f64, max: f64) -> Self {
        Self { min, max }
    }

    /// The interval that holds one number.
    pub const fn point(value: f64) -> Self {
        Self { min: value, max: value }
    }

    /// The interval that holds nothing.
    pub const EMPTY: Self = Self { min: f64::INFINITY, max: f64::NEG_INFINITY };

    /// Whether no number lies inside.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.min > self.max
    }

    /// The smallest interval that holds both.
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// What both have in common.
    #[inline(always)]
    pub fn intersection(self, other: Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// The largest absolute value inside; 0 when empty.
    pub fn magnitude(&self) -> f64 {
        if self.is_empty() { 0.0 } else { self.min.abs().max(self.max.abs()) }
    }
}

impl Add for Interval {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { min: self.min + other.min, max: self.max + other.max }
    }
}

impl Sub for Interval {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self { min: self.min - other.max, max: self.max - other.min }
    }
}

impl Neg for Interval {
    type Output = Self;

    fn neg(self) -> Self {
        Self { min: -self.max, max: -self.min }
    }
}

impl Mul for Interval {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let [a, b, c, d] = [self.min * other.min, self.min * other.max, self.max * other.min, self.max * other.max];
        Self { min: a.min(b).min(c.min(d)), max: a.max(b).max(c.max(d)) }
    }
}

/// A closed axis-aligned rectangle in the tangential plane of a pane, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rect {
    /// The corner with the smallest coordinates.
    pub min: DVec2,
    /// The corner with the largest coordinates.
    pub max: DVec2,
}

impl Rect {
    /// The rectangle between two corners.
    pub const fn new(min: DVec2, max: DVec2) -> Self {
        Self { min, max }
    }

    /// Whether no point lies inside.
    pub fn is_empty(&self) -> bool {
        self.min.x > self.max.x || self.min.y > self.max.y
    }

    /// Whether `point` lies inside or on the border.
    #[inline(always)]
    pub fn contains(&self, point: DVec2) -> bool {
        point.cmpge(self.min).all() && point.cmple(self.max).all()
    }

    /// What both have in common.
    pub fn intersection(&self, other: &Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// The rectangle grown by `margin` on every side.
    #[inline(always)]
    pub fn grown(&self, margin: f64) -> Self {
        Self { min: self.min - margin, max: self.max + margin }
    }

    /// The two halves across its longer side.
    #[inline(always)]
    pub fn halves(&self) -> [Self; 2] {
        let size = self.max - self.min;
        let (mut low, mut high) = (*self, *self);
        if size.x >= size.y {
            low.max.x = self.min.x + 0.5 * size.x;
            high.min.x = low.max.x;
        } else {
            low.max.y = self.min.y + 0.5 * size.y;
            high.min.y = low.max.y;
        }
        [low, high]
    }

    /// The point in the middle.
    #[inline(always)]
    pub fn centre(&self) -> DVec2 {
        self.min + 0.5 * (self.max - self.min)
    }

    /// Width times height.
    #[inline(always)]
    pub fn area(&self) -> f64 {
        let size = self.max - self.min;
        size.x * size.y
    }
}
