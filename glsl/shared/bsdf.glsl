// f = kd·c/π + ks·D·G/(4 cosθi cosθo): Lambert and GGX with separable Smith G, Fresnel 1 (DESIGN §2).
// Walter et al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007.

#define PI 3.14159265f
#define INV_PI 0.318309886f

#ifdef HAS_GLOSSY
// GGX distribution for α > 0. sin² comes from the cross product: 1 − cos² would lose the whole lobe at small α.
Real ggx_d(Vec3 normal, Vec3 half_way, Real alpha) {
    Vec3 across = cross3(normal, half_way);
    Real cos_h = dot3(normal, half_way);
    Real alpha2 = alpha * alpha;
    Real denominator = dot3(across, across) + alpha2 * cos_h * cos_h;
    return alpha2 * INV_PI / (denominator * denominator);
}

// Half of Smith's G1 over cosθ: G/(4 cosθi cosθo) is the product of two of these, without a division by cosθ.
Real smith_v(Real cosine, Real alpha) {
    return 1.0f / (cosine + sqrt(cosine * cosine + alpha * alpha * (1.0f - cosine * cosine)));
}

// The GGX lobe's value; both cosines are positive.
Real ggx(Vec3 normal, Vec3 to_viewer, Vec3 to_light, Real cos_o, Real cos_i, Real alpha) {
    Vec3 half_way = normalize3(add3(to_viewer, to_light));
    return ggx_d(normal, half_way, alpha) * smith_v(cos_o, alpha) * smith_v(cos_i, alpha);
}
#endif
