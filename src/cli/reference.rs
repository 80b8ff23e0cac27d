//! `photile reference SCENE`: an f64 reference image with its standard error.
