// What rays meet: a hit, the point on a surface with all that shading needs, and the faces that photons lie on.
//
// A *shape* is what rays meet, a *material* how it scatters, a *sheet* the surface that photons, cells and caches know.
// A *face* is one side of a sheet. No epsilon anywhere: a ray that starts on a surface names the face that it leaves, and
// that surface's other root is taken exactly, so neither scale nor distance from the world's origin can make a surface
// hit itself.
//
// Mostly the camera and all lights are outside of every sphere and on the front of every plane; whatever light meets
// is then met from there. Which side a ray is on is known, not computed: a point that rounding has put a hair behind
// a surface, beside an edge or a contact, meets that surface at once. So no ray leaves a closed room, whatever the
// device's arithmetic. Only scenes with HAS_TWO_SIDED have to ask.

#define NO_SHAPE (-1)
#define NO_FACE (-1)

// Every kind of shape so far is one sheet, so a sheet has its shape's number.
#define SHEET_OF_SHAPE(shape) (shape)
#define SHAPE_OF_SHEET(sheet) (sheet)

// A sheet has two faces: the side that its normal points to, and the one behind. This is the only place that numbers
// them in shaders and kernels (in the host's: records/face.rs).
#define FACE_OF(sheet, behind) ((sheet) * 2 + (behind))
#define SHEET_OF(face) ((face) >> 1)
#define IS_BEHIND(face) (((face) & 1) != 0)
#define SHAPE_OF(face) SHAPE_OF_SHEET(SHEET_OF(face))

// Row of the material table. Where shapes are few enough to have a row each, in their order, no index is fetched.
#ifdef SHARED_MATERIALS
#define MATERIAL_OF(shape) to_int(shape_material(shape))
#else
#define MATERIAL_OF(shape) (shape)
#endif

#define LEAST_DISTANCE 1e-18f // of a hit: a root that rounding has brought to nothing or behind is still in front

STRUCT(Hit)
struct Hit {
    Real t;     // distance in units of the (unit) direction, INFINITE when nothing is hit
    Int shape;  // NO_SHAPE when nothing is hit
    Int from;   // face that the ray leaves, or NO_FACE
};

// A hit point put back on its shape.
STRUCT(Placed)
struct Placed {
    Vec3 position; // scene space
    Vec3 normal;   // unit, the shape's own
};

// A point on a surface with all that shading needs.
STRUCT(Surface)
struct Surface {
    Vec3 position; // scene space, back on the surface to an ulp
    Vec3 normal;   // unit, towards the side the ray came from
    Int shape;
    Real side;     // +1 on the side that the stored normal points to, else −1
};

// What a ray that goes on from here leaves.
Int face_left(Surface surface) { return FACE_OF(SHEET_OF_SHAPE(surface.shape), pick_i(surface.side < 0.0f, 1, 0)); }

// Coordinates of a point in its sheet's chart, in [−1, 1]² where the chart has an end.
STRUCT(ChartPoint)
struct ChartPoint {
    Real u;
    Real v;
};

// Sum of a point's coordinates: what rounding is measured by.
Real size_of(Vec3 p) { return fabs(p.x) + fabs(p.y) + fabs(p.z); }

#define MARGIN 1e-6f // of a point's size, eight ulps: so far from all other surfaces that its side is known
#define UNSURE 6e-7f // nearer than this it is moved; computing a side is wrong by 2.5e-7 at most

#ifdef HAS_CLIP
// The line in which a plane cuts the tangent plane around a query point: points p (from the query point, in radii) with
// dot(across, p) = beyond.
STRUCT(Cut)
struct Cut {
    Vec3 across; // the part in the tangent plane of the plane's normal, from the query point towards it
    Real sine2;  // its squared length: the line is beyond/√sine2 away
    Real beyond; // more than 0, so that arctan2 has an angle on the very line
};
#endif
