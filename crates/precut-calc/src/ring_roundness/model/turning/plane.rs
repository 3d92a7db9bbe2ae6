//! Vectors in the cross-section, mm or without a unit.

pub(crate) type Vec2 = [f64; 2];

#[inline]
pub(crate) fn add(p: Vec2, q: Vec2) -> Vec2 {
    [p[0] + q[0], p[1] + q[1]]
}
#[inline]
pub(crate) fn sub(p: Vec2, q: Vec2) -> Vec2 {
    [p[0] - q[0], p[1] - q[1]]
}
#[inline]
pub(crate) fn scaled(p: Vec2, by: f64) -> Vec2 {
    [p[0] * by, p[1] * by]
}
#[inline]
pub(crate) fn dot(p: Vec2, q: Vec2) -> f64 {
    p[0] * q[0] + p[1] * q[1]
}
#[inline]
pub(crate) fn cross(p: Vec2, q: Vec2) -> f64 {
    p[0] * q[1] - p[1] * q[0]
}
#[inline]
pub(crate) fn norm(p: Vec2) -> f64 {
    dot(p, p).sqrt()
}
/// Turned by +90°.
#[inline]
pub(crate) fn turned(p: Vec2) -> Vec2 {
    [-p[1], p[0]]
}
/// Turned counter-clockwise by an angle, rad.
pub(crate) fn rotated(p: Vec2, by_rad: f64) -> Vec2 {
    let (sin, cos) = by_rad.sin_cos();
    [cos * p[0] - sin * p[1], sin * p[0] + cos * p[1]]
}
/// Angle from the x axis, rad.
pub(crate) fn angle(p: Vec2) -> f64 {
    p[1].atan2(p[0])
}
/// The direction at an angle, rad.
pub(crate) fn direction(angle_rad: f64) -> Vec2 {
    [angle_rad.cos(), angle_rad.sin()]
}
/// Unit vector along `p`; `p` must not vanish.
pub(crate) fn unit(p: Vec2) -> Vec2 {
    scaled(p, 1.0 / norm(p))
}
