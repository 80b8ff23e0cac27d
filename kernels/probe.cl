// Whether a device really computes: i² + 1 for each work-item.
__kernel void probe(__global uint *squares) {
    uint i = (uint)get_global_id(0);
    squares[i] = i * i + 1u;
}
