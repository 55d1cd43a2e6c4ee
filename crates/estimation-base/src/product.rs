//! Products of manifolds: a macro that writes the struct's [`crate::Manifold`] from its fields.

/// A struct whose fields are manifolds, as one manifold: the tangents of the fields one after the other.
///
/// Each field has its type and the dimension of its tangent; the first line says the sum, which the compiler checks. The
/// struct derives `Clone`, and whatever else is asked for. For `f32` write `Manifold<D, f32>` where `Manifold<D>` stands.
///
/// ```
/// use estimation_base::nalgebra::{Vector2, Vector5};
/// use estimation_base::{Manifold, Se2, product_manifold};
///
/// product_manifold! {
///     /// A robot in the plane and a landmark that it has seen.
///     #[derive(Debug, Clone, Copy, PartialEq)]
///     pub struct RobotAndLandmark: Manifold<5> {
///         /// The pose of the robot.
///         pub robot: Se2 = 3,
///         /// The place of the landmark, metres.
///         pub landmark: Vector2<f64> = 2,
///     }
/// }
///
/// let start = RobotAndLandmark { robot: Se2::new(0.0, 0.0, 3.0), landmark: Vector2::new(4.0, 1.0) };
/// let moved = start.retract(&Vector5::new(1.0, 0.0, 0.5, 0.0, 2.0));
/// assert!(moved.robot.phi < 0.0); // past the cut
/// assert_eq!(moved.landmark, Vector2::new(4.0, 3.0));
/// let back = start.local(&moved);
/// assert!((back - Vector5::new(1.0, 0.0, 0.5, 0.0, 2.0)).amax() < 1e-15);
/// ```
///
/// A sum that is wrong does not compile:
///
/// ```compile_fail
/// use estimation_base::{Angle, product_manifold};
///
/// product_manifold! {
///     #[derive(Clone)]
///     struct Two: Manifold<3> {
///         pub first: Angle = 1,
///         pub second: Angle = 1,
///     }
/// }
/// ```
#[macro_export]
macro_rules! product_manifold {
    (
        $(#[$meta:meta])*
        $visibility:vis struct $name:ident: Manifold<$total:literal> {
            $($fields:tt)*
        }
    ) => {
        $crate::product_manifold! {
            $(#[$meta])*
            $visibility struct $name: Manifold<$total, f64> {
                $($fields)*
            }
        }
    };
    (
        $(#[$meta:meta])*
        $visibility:vis struct $name:ident: Manifold<$total:literal, $scalar:ty> {
            $(
                $(#[$field_meta:meta])*
                $field_visibility:vis $field:ident: $kind:ty = $dimension:literal
            ),+ $(,)?
        }
    ) => {
        $(#[$meta])*
        $visibility struct $name {
            $(
                $(#[$field_meta])*
                $field_visibility $field: $kind,
            )+
        }

        impl $crate::Manifold<$total, $scalar> for $name {
            fn retract(&self, tangent: &$crate::nalgebra::SVector<$scalar, $total>) -> Self {
                const {
                    assert!(
                        0 $(+ $dimension)+ == $total,
                        "the dimensions of the fields do not sum to that of the product"
                    );
                }
                let mut at = 0;
                $(
                    let $field = {
                        let part = tangent.fixed_rows::<$dimension>(at).into_owned();
                        at += $dimension;
                        <$kind as $crate::Manifold<$dimension, $scalar>>::retract(&self.$field, &part)
                    };
                )+
                let _ = at;
                Self { $($field),+ }
            }

            fn local(&self, other: &Self) -> $crate::nalgebra::SVector<$scalar, $total> {
                let mut tangent = $crate::nalgebra::SVector::<$scalar, $total>::zeros();
                let mut at = 0;
                $(
                    let part = <$kind as $crate::Manifold<$dimension, $scalar>>::local(
                        &self.$field,
                        &other.$field,
                    );
                    tangent.fixed_rows_mut::<$dimension>(at).copy_from(&part);
                    at += $dimension;
                )+
                let _ = at;
                tangent
            }
        }
    };
}
