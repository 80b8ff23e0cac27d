// Faults that `photile stress` must find: code as it is often written. Without a FAULT_ define there is nothing here.

#ifdef FAULT_NAIVE_SPHERE
// The school's formula: b² − c cancels for small and far spheres, and −b + √ for near roots.
Real naive_sphere(Vec3 origin, Vec3 direction, Vec3 center, Real radius, Bool origin_on, Bool behind) {
    Vec3 from_center = sub3(origin, center);
    Real b = dot3(from_center, direction);
    Real c = dot3(from_center, from_center) - radius * radius;
    Real discriminant = b * b - c;
    Real root = sqrt(max(discriminant, lanes(0.0f)));
    Real near_root = 0.0f - b - root;
    Real far_root = 0.0f - b + root;
    Real t = pick(near_root > 0.0f, near_root, far_root);
    Bool hit = discriminant >= 0.0f && t > 0.0f;
    return pick(hit, t, INFINITE);
}
#endif

#ifdef FAULT_FIXED_EPSILON
// Any hit farther than a millimetre counts, whatever the scene's scale.
Real epsilon_plane(Vec3 origin, Vec3 direction, Vec3 normal, Real offset, Bool origin_on) {
    Real t = (offset - dot3(normal, origin)) / dot3(normal, direction);
    Bool hit = t > 1e-3f && t < INFINITE;
    return pick(hit, t, INFINITE);
}
#endif

#ifdef FAULT_NAIVE_SPHERE
#define hit_sphere naive_sphere
#endif
#ifdef FAULT_FIXED_EPSILON
#define hit_plane epsilon_plane
#endif
