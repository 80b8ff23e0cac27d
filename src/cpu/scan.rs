//! Twin of `kernels/scan.cl`: exclusive prefix sums.

/// Replaces each value by the sum of all before it and returns the sum of all, modulo 2³².
pub fn exclusive_scan(values: &mut [u32]) -> u32 {
    let mut sum = 0u32;
    for value in values {
        let before = sum;
        sum = sum.wrapping_add(*value);
        *value = before;
    }
    sum
}
