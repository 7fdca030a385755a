//! Data that the ranks of two codes exchange: plain data with a fixed layout, which both sides compare before the first
//! exchange.

use std::fmt;

use bytemuck::Pod;

/// Plain data that can be exchanged: it contains neither pointers nor padding bytes.
///
/// Numbers and arrays of them are payloads, and so are the local values of the vectors of each backend
/// ([`VectorOps::with_local`](crate::las::VectorOps::with_local)); [`payload!`](crate::payload) defines a structure
/// that is a payload.
pub trait Payload: Pod + Send {
    /// Returns the memory layout of the type.
    fn layout() -> Layout;
}

/// The memory layout of a payload, which two codes that exchange it must agree on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// The fields with their types, in order.
    pub fields: String,
    /// Size in bytes.
    pub size: usize,
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({} bytes)", self.fields, self.size)
    }
}

macro_rules! numbers {
    ($($of:ty)*) => {$(
        impl Payload for $of {
            fn layout() -> Layout {
                Layout { fields: stringify!($of).into(), size: size_of::<$of>() }
            }
        }
    )*};
}

numbers!(u8 i8 u16 i16 u32 i32 u64 i64 f32 f64);

impl<T: Payload, const N: usize> Payload for [T; N] {
    fn layout() -> Layout {
        let Layout { fields, size } = T::layout();
        Layout { fields: format!("[{fields}; {N}]"), size: N * size }
    }
}

/// Defines a structure that implements `Payload`.
///
/// ```
/// biotissue::payload! {
///     /// The response of an RVE.
///     pub struct Response {
///         /// First Piola-Kirchhoff stress, Pa.
///         pub stress: [f64; 9],
///         /// Newton iterations that it took.
///         pub iterations: u64,
///     }
/// }
/// use biotissue::las::Payload;
/// assert_eq!(Response::layout().to_string(), "{ stress: [f64; 9], iterations: u64 } (80 bytes)");
/// ```
#[macro_export]
macro_rules! payload {
    ($(#[$attribute:meta])* $visible:vis struct $name:ident {
        $($(#[$field_attribute:meta])* $field_visible:vis $field:ident: $of:ty),* $(,)?
    }) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, $crate::las::bytemuck::Zeroable, $crate::las::bytemuck::Pod)]
        #[bytemuck(crate = "::biotissue::las::bytemuck")]
        #[repr(C)]
        $visible struct $name {
            $($(#[$field_attribute])* $field_visible $field: $of),*
        }

        impl $crate::las::Payload for $name {
            fn layout() -> $crate::las::Layout {
                let fields = [$((stringify!($field), <$of as $crate::las::Payload>::layout().fields)),*];
                let fields = fields.map(|(name, of)| format!("{name}: {of}")).join(", ");
                $crate::las::Layout { fields: format!("{{ {fields} }}"), size: size_of::<$name>() }
            }
        }
    };
}
