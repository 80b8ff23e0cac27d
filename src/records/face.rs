//! Sheets and their faces. A *sheet* is the surface that photons, cells and caches know: one for each surface whose
//! neighbourhood may be gathered together. A *face* is one side of a sheet. This is the only place on the host that numbers
//! them (in shaders: `glsl/shared/surface.glsl`).

/// The face of a sheet on the side that its normal points to, or behind it.
pub fn face_of(sheet: usize, behind: bool) -> usize {
    2 * sheet + usize::from(behind)
}

/// The sheet that a face is a side of.
pub fn sheet_of(face: usize) -> usize {
    face / 2
}

/// Whether a face is the side that its sheet's normal does not point to.
pub fn is_behind(face: usize) -> bool {
    face % 2 == 1
}

/// Faces of so many sheets.
pub fn faces_of(sheets: usize) -> usize {
    2 * sheets
}

/// The sheet of a shape: every kind so far is one sheet, so it has its shape's number.
pub fn sheet_of_shape(shape: usize) -> usize {
    shape
}

/// The shape that a sheet is a part of.
pub fn shape_of_sheet(sheet: usize) -> usize {
    sheet
}
