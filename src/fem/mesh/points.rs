//! Numbering of the integration points of a mesh.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use super::cells::Elements;

/// The integration points of all elements, numbered from 0: those of an element are consecutive, in the order of its
/// quadrature rule, and elements follow each other in mesh order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct PointNumbering {
    blocks: Vec<PointBlock>,
    elements: usize,
    points: usize,
    whole: Option<InWhole>,
}

/// The numbers of the elements of a part of a mesh in the whole mesh, and those of their first points.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
struct InWhole {
    elements: Arc<[u32]>,
    first_points: Arc<[u32]>,
}

/// The points of consecutive elements of one type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
struct PointBlock {
    first_element: usize,
    first_point: usize,
    per_element: usize,
}

/// An integration point in terms of its element. The text is `element 5` if the element has a single point, and
/// `element 5, point 2` otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct IntegrationPoint {
    /// The element, from 0.
    pub element: u32,
    /// The point within the element, from 0.
    pub point: u16,
    /// Number of points of the element.
    pub points: u16,
}

impl IntegrationPoint {
    /// Returns the only point of an element.
    pub fn of_element(element: usize) -> Self {
        Self { element: element as u32, point: 0, points: 1 }
    }
}

impl fmt::Display for IntegrationPoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "element {}", self.element)?;
        if self.points > 1 { write!(f, ", point {}", self.point) } else { Ok(()) }
    }
}

impl PointNumbering {
    /// Numbers the points of elements.
    pub(super) fn new(elements: &Elements) -> Self {
        let (mut blocks, mut first_point) = (Vec::new(), 0);
        for block in elements.blocks() {
            let per_element = block.cell_type().points();
            blocks.push(PointBlock { first_element: block.range().start, first_point, per_element });
            first_point += per_element * block.len();
        }
        Self { blocks, elements: elements.len(), points: first_point, whole: None }
    }

    /// Numbers the points of a part of a mesh, given the numbers of its elements and of their first points in the whole
    /// mesh.
    pub(super) fn of_part(elements: &Elements, in_whole: &Arc<[u32]>, first_points: Arc<[u32]>) -> Self {
        Self { whole: Some(InWhole { elements: Arc::clone(in_whole), first_points }), ..Self::new(elements) }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points
    }

    /// Returns true if there are no points.
    pub fn is_empty(&self) -> bool {
        self.points == 0
    }

    /// Number of elements.
    pub fn elements(&self) -> usize {
        self.elements
    }

    /// Returns the points of an element.
    ///
    /// # Panics
    /// Panics if the element does not exist.
    pub fn of_element(&self, element: usize) -> Range<usize> {
        assert!(element < self.elements, "element {element} of {}", self.elements);
        let block = self.blocks[self.blocks.partition_point(|block| block.first_element <= element) - 1];
        let first = block.first_point + (element - block.first_element) * block.per_element;
        first..first + block.per_element
    }

    /// Returns the element of a point, and the position of the point within it. In a part of a mesh, the element has
    /// its number in the whole mesh.
    ///
    /// # Panics
    /// Panics if the point does not exist.
    pub fn locate(&self, point: usize) -> IntegrationPoint {
        assert!(point < self.points, "point {point} of {}", self.points);
        let block = self.blocks[self.blocks.partition_point(|block| block.first_point <= point) - 1];
        let number = point - block.first_point;
        let element = block.first_element + number / block.per_element;
        IntegrationPoint {
            element: self.whole.as_ref().map_or(element as u32, |whole| whole.elements[element]),
            point: (number % block.per_element) as u16,
            points: block.per_element as u16,
        }
    }

    /// Returns the number of a point in the whole mesh, if this is a part of one.
    ///
    /// # Panics
    /// Panics if the point does not exist.
    pub fn in_whole(&self, point: usize) -> usize {
        assert!(point < self.points, "point {point} of {}", self.points);
        let Some(whole) = &self.whole else { return point };
        let block = self.blocks[self.blocks.partition_point(|block| block.first_point <= point) - 1];
        let number = point - block.first_point;
        let element = block.first_element + number / block.per_element;
        whole.first_points[element] as usize + number % block.per_element
    }

    /// Returns the value of the element of each point, given one value per element.
    ///
    /// # Panics
    /// Panics if there are fewer values than elements.
    pub fn spread<T: Copy>(&self, of_elements: &[T]) -> Vec<T> {
        let mut of_points = Vec::with_capacity(self.points);
        let ends = self.blocks.iter().skip(1).map(|block| block.first_element).chain([self.elements]);
        for (block, end) in self.blocks.iter().zip(ends) {
            for &value in &of_elements[block.first_element..end] {
                of_points.extend(std::iter::repeat_n(value, block.per_element));
            }
        }
        of_points
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::element::ElementType;

    #[test]
    fn points_follow_their_elements() {
        let mut elements = Elements::from(vec![[0, 1, 2, 3], [1, 2, 3, 4]]);
        elements.push(ElementType::Wedge6, &[0, 1, 2, 3, 4, 5]);
        elements.push(ElementType::Wedge6, &[6, 1, 2, 3, 4, 5]);
        elements.push(ElementType::Tet4, &[5, 6, 7, 8]);
        let points = PointNumbering::new(&elements);
        assert_eq!((points.len(), points.elements(), points.is_empty()), (15, 5, false));
        for element in 0..5 {
            for (local, point) in points.of_element(element).enumerate() {
                let found = points.locate(point);
                assert_eq!((found.element as usize, usize::from(found.point)), (element, local));
            }
        }
        assert_eq!(points.of_element(3), 8..14);
        assert_eq!(points.locate(1).to_string(), "element 1");
        assert_eq!(points.locate(13).to_string(), "element 3, point 5");
        assert_eq!(points.spread(&[7, 8, 9, 10, 11])[7..9], [9, 10]);
    }
}
