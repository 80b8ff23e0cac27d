//! Sheets: what photons, cells and caches are about.

use glam::DVec3;

/// A surface whose neighbourhood may be gathered together. Every shape so far is one sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sheet {
    /// In the plane `dot(normal, p) = offset`.
    Flat {
        /// Unit.
        normal: DVec3,
        /// Metres.
        offset: f64,
    },
    /// A sphere's.
    Round {
        /// Of the sphere.
        center: DVec3,
        /// Of the sphere, metres.
        radius: f64,
    },
}

impl Sheet {
    /// Metres from the surface (or its plane) to a point, more than 0 where the normal points to.
    pub fn height(&self, p: DVec3) -> f64 {
        match *self {
            Sheet::Flat { normal, offset } => normal.dot(p) - offset,
            Sheet::Round { center, radius } => p.distance(center) - radius,
        }
    }

    /// Unit; a sphere's points outwards.
    pub fn normal(&self, at: DVec3) -> DVec3 {
        match *self {
            Sheet::Flat { normal, .. } => normal,
            Sheet::Round { center, .. } => (at - center).normalize(),
        }
    }

    /// −1, +1, or 0 within rounding of the surface. Packed coordinates are small near `near`.
    pub fn side(&self, p: DVec3, near: DVec3) -> f64 {
        let height = self.height(p);
        let rounding = match *self {
            Sheet::Flat { normal, offset } => {
                let offset = offset - normal.dot(near);
                // 1e-5 of the numbers that cancel: float32 resolves them to 1e-7, so this is safely on one side.
                1e-5 * ((p - near).abs().dot(normal.abs()) + offset.abs())
            }
            // 16 times what float32 makes of it; spheres of 1e5 m, as walls, may be a metre off.
            Sheet::Round { center, radius } => 1e-6 * ((p - near).length() + (center - near).length() + radius),
        };
        if height.abs() <= rounding { 0.0 } else { height.signum() }
    }

    /// Least radius of curvature, metres; infinite where it is flat.
    pub fn curvature_radius(&self) -> f64 {
        match *self {
            Sheet::Flat { .. } => f64::INFINITY,
            Sheet::Round { radius, .. } => radius,
        }
    }

    /// Whether light from `p` comes to the side that the normal points to, or to the other one. Light on the surface
    /// itself shines to both.
    pub fn is_lit(&self, p: DVec3, front: bool) -> bool {
        let side = if front { 1.0 } else { -1.0 };
        match *self {
            Sheet::Flat { .. } => side * self.height(p) >= 0.0,
            Sheet::Round { center, radius } => side * (p.distance(center) / radius - 1.0) > -1e-6,
        }
    }

    /// Whether a point is within a closed surface.
    pub fn holds(&self, p: DVec3) -> bool {
        match *self {
            Sheet::Flat { .. } => false,
            Sheet::Round { center, radius } => p.distance_squared(center) < radius * radius,
        }
    }

    /// Whether it lies across x, as far as it lies across any axis.
    pub fn is_across_x(&self) -> bool {
        match *self {
            Sheet::Flat { normal, .. } => {
                let [x, y, z] = normal.abs().to_array();
                x > y.max(z)
            }
            Sheet::Round { .. } => false,
        }
    }
}
