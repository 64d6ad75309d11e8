//! The transcendental functions that nodes and the simulator use.
//!
//! The C library's sin, exp, pow and atan2 give other last bits on other CPUs; the pinned `libm` crate does not. All
//! that must repeat bit for bit goes through here (clippy refuses the standard methods elsewhere).

/// Sine of `x` [rad].
pub fn sin(x: f64) -> f64 {
    libm::sin(x)
}

/// Cosine of `x` [rad].
pub fn cos(x: f64) -> f64 {
    libm::cos(x)
}

/// Sine and cosine of `x` [rad].
pub fn sin_cos(x: f64) -> (f64, f64) {
    libm::sincos(x)
}

/// Sine and cosine of `x` to single precision [rad]: half the time, for bearings that are an `f32` anyway.
pub fn sin_cos_f32(x: f32) -> (f32, f32) {
    libm::sincosf(x)
}

/// Tangent of `x` [rad].
pub fn tan(x: f64) -> f64 {
    libm::tan(x)
}

/// Arc tangent [rad].
pub fn atan(x: f64) -> f64 {
    libm::atan(x)
}

/// Angle of the point (`x`, `y`) [rad].
pub fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// Angle of the point (`x`, `y`) to single precision [rad]: half the time, for what is written as a `f32` anyway.
pub fn atan2_f32(y: f32, x: f32) -> f32 {
    libm::atan2f(y, x)
}

/// Arc sine [rad].
pub fn asin(x: f64) -> f64 {
    libm::asin(x)
}

/// Arc cosine [rad].
pub fn acos(x: f64) -> f64 {
    libm::acos(x)
}

/// Length of the vector (`x`, `y`).
pub fn hypot(x: f64, y: f64) -> f64 {
    // The square root is exact to the last bit on every CPU; lengths here are far from overflow.
    (x * x + y * y).sqrt()
}

/// e to the power of `x`.
pub fn exp(x: f64) -> f64 {
    libm::exp(x)
}

/// Natural logarithm.
pub fn ln(x: f64) -> f64 {
    libm::log(x)
}

/// `x` to the power of `y`.
pub fn pow(x: f64, y: f64) -> f64 {
    libm::pow(x, y)
}

/// `angle` brought into (−π, π] [rad].
pub fn wrap_angle(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    if angle > -PI && angle <= PI {
        return angle;
    }
    let turned = angle - TAU * ((angle + PI) / TAU).floor();
    // Rounding may leave exactly −π, which is the same direction as π.
    if turned <= -PI {
        turned + TAU
    } else if turned > PI {
        turned - TAU
    } else {
        turned
    }
}

/// One fixed NaN for all, so that equal results have equal bytes.
pub fn canonical(x: f64) -> f64 {
    if x.is_nan() { f64::NAN } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn angles_wrap_into_the_half_open_circle() {
        assert_eq!(wrap_angle(PI), PI);
        assert_eq!(wrap_angle(-PI), PI);
        assert!((wrap_angle(3.0 * PI) - PI).abs() < 1e-12);
        assert!((wrap_angle(-0.1) + 0.1).abs() < 1e-15);
        for k in -20..20 {
            let wrapped = wrap_angle(1.0 + k as f64 * 2.0 * PI);
            assert!((wrapped - 1.0).abs() < 1e-9, "{k}: {wrapped}");
        }
    }

    #[test]
    fn arc_tangent_knows_all_four_quadrants() {
        assert!((atan2(-1.0, -1.0) + 0.75 * PI).abs() < 1e-15);
    }
}
