//! Curves on logarithmic axes, as SVG and PNG.

use std::io::Write as _;
use std::path::Path;
use std::sync::Once;

use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use plotters::coord::Shift;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::prelude::*;

use crate::error::{Error, Result};
use crate::film::write_beside;

/// Width and height of a plot, pixels.
const SIZE: (u32, u32) = (960, 600);

/// Dark enough on white, and apart for colour-blind eyes too (Okabe & Ito 2008).
const COLORS: [RGBColor; 9] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
    RGBColor(95, 95, 95),
    RGBColor(165, 165, 165),
];

/// Curves from which on the legend stands beside the axes rather than in their corner.
const MANY: usize = 6;

/// Pixels that it takes there.
const BESIDE: u32 = 210;

/// A line through points.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// What the legend calls it.
    pub name: String,
    /// x and y, both > 0.
    pub points: Vec<(f64, f64)>,
    /// Number of a point that is to stand out.
    pub marked: Option<usize>,
    /// Colour and dashes.
    pub look: Look,
}

/// How a curve is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Look {
    /// Number of a colour; `None`: the next one.
    pub color: Option<usize>,
    /// Length of dashes, pixels; 0: a line without gaps.
    pub dash: u32,
}

impl Look {
    /// Number of a light grey, for what is there to compare with.
    pub const GREY: usize = COLORS.len() - 1;
    /// Of a darker one.
    pub const DARK_GREY: usize = COLORS.len() - 2;
}

/// Curves on common axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// The line above the axes.
    pub title: String,
    /// Quantity and unit.
    pub x: String,
    /// Quantity and unit.
    pub y: String,
    /// In the legend's order.
    pub curves: Vec<Curve>,
}

impl Chart {
    /// Writes it as SVG.
    ///
    /// # Errors
    /// [`Error::Failed`] where no point can stand on logarithmic axes, [`Error::File`].
    pub fn write_svg(&self, path: &Path) -> Result<()> {
        let mut text = String::new();
        self.draw(SVGBackend::with_string(&mut text, SIZE).into_drawing_area())?;
        write_beside(path, |file| file.write_all(text.as_bytes()))
    }

    /// Writes it as PNG.
    ///
    /// # Errors
    /// As [`Chart::write_svg`].
    pub fn write_png(&self, path: &Path) -> Result<()> {
        let mut pixels = vec![0; 3 * SIZE.0 as usize * SIZE.1 as usize];
        self.draw(BitMapBackend::with_buffer(&mut pixels, SIZE).into_drawing_area())?;
        write_beside(path, |file| {
            let encoded = PngEncoder::new(file).write_image(&pixels, SIZE.0, SIZE.1, ExtendedColorType::Rgb8);
            encoded.map_err(std::io::Error::other)
        })
    }

    fn draw<B: DrawingBackend>(&self, area: DrawingArea<B, Shift>) -> Result<()> {
        let (x, y) = (self.range(|p| p.0)?, self.range(|p| p.1)?);
        self.draw_in(&area, x, y).map_err(|error| Error::Failed(format!("plot '{}': {error}", self.title)))
    }

    fn draw_in<B: DrawingBackend>(
        &self,
        area: &DrawingArea<B, Shift>,
        x: (f64, f64),
        y: (f64, f64),
    ) -> std::result::Result<(), DrawingAreaErrorKind<B::ErrorType>> {
        set_font();
        area.fill(&WHITE)?;
        let beside = self.curves.len() >= MANY;
        let (axes, legend) = area.split_horizontally(SIZE.0 - if beside { BESIDE } else { 0 });
        let mut chart = ChartBuilder::on(&axes)
            .caption(&self.title, ("sans-serif", 18))
            .margin(16)
            .x_label_area_size(48)
            .y_label_area_size(72)
            .build_cartesian_2d(LogAxis(x.0, x.1), LogAxis(y.0, y.1))?;
        chart
            .configure_mesh()
            .x_desc(&self.x)
            .y_desc(&self.y)
            .label_style(("sans-serif", 14))
            .axis_desc_style(("sans-serif", 16))
            .light_line_style(BLACK.mix(0.06))
            .bold_line_style(BLACK.mix(0.15))
            .draw()?;
        for (number, curve) in self.curves.iter().enumerate() {
            let color = COLORS[curve.look.color.unwrap_or(number) % COLORS.len()];
            let line = color.stroke_width(2);
            let points: Vec<(f64, f64)> = curve.points.iter().copied().filter(is_drawable).collect();
            let drawn = match curve.look.dash {
                0 => chart.draw_series(LineSeries::new(points.iter().copied(), line))?,
                dash => chart.draw_series(DashedLineSeries::new(points.iter().copied(), dash, dash, line))?,
            };
            if !beside {
                drawn
                    .label(&curve.name)
                    .legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], color.stroke_width(2)));
            }
            chart.draw_series(points.iter().map(|p| Circle::new(*p, 3, color.filled())))?;
            let marked = curve.marked.and_then(|place| curve.points.get(place)).filter(|p| is_drawable(p));
            chart.draw_series(marked.map(|p| Circle::new(*p, 8, color.stroke_width(2))))?;
        }
        if beside {
            self.draw_legend(&legend)?;
        } else {
            chart
                .configure_series_labels()
                .position(SeriesLabelPosition::UpperRight)
                .background_style(WHITE.mix(0.85))
                .border_style(BLACK.mix(0.3))
                .label_font(("sans-serif", 14))
                .draw()?;
        }
        area.present()
    }

    /// A line and a name each, below one another.
    fn draw_legend<B: DrawingBackend>(
        &self,
        area: &DrawingArea<B, Shift>,
    ) -> std::result::Result<(), DrawingAreaErrorKind<B::ErrorType>> {
        for (number, curve) in self.curves.iter().enumerate() {
            let color = COLORS[curve.look.color.unwrap_or(number) % COLORS.len()];
            let y = 60 + 24 * number as i32;
            let (dash, end) = (curve.look.dash as i32, 34);
            let step = if dash == 0 { end } else { 2 * dash };
            for x in (0..end).step_by(step as usize) {
                let stop = if dash == 0 { end } else { (x + dash).min(end) };
                area.draw(&PathElement::new([(x, y), (stop, y)], color.stroke_width(2)))?;
            }
            area.draw(&Circle::new((end / 2, y), 3, color.filled()))?;
            area.draw(&Text::new(curve.name.as_str(), (end + 8, y - 7), ("sans-serif", 14)))?;
        }
        Ok(())
    }

    /// From the least to the largest, with air on both ends.
    fn range(&self, axis: impl Fn(&(f64, f64)) -> f64) -> Result<(f64, f64)> {
        let values: Vec<f64> =
            self.curves.iter().flat_map(|curve| &curve.points).filter(|p| is_drawable(p)).map(axis).collect();
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(0.0, f64::max);
        if values.is_empty() {
            return Err(Error::Failed(format!("plot '{}': no point is finite and above 0", self.title)));
        }
        Ok((low / 1.1, high * 1.1))
    }
}

/// From the first to the second value. The library's own logarithmic axis has a label or two in a decade.
struct LogAxis(f64, f64);

impl Ranged for LogAxis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let share = (value / self.0).ln() / (self.1 / self.0).ln();
        limit.0 + (share * f64::from(limit.1 - limit.0)).round() as i32
    }

    /// 1, 2, 5 times each power of ten where there is room, else the powers alone, every so many of them.
    fn key_points<H: KeyPointHint>(&self, hint: H) -> Vec<f64> {
        let powers = self.0.log10().floor() as i32..=self.1.log10().ceil() as i32;
        let of = |steps: &[f64], every: usize| -> Vec<f64> {
            let all = powers.clone().step_by(every).flat_map(|power| steps.iter().map(move |s| s * 10f64.powi(power)));
            all.filter(|point| (self.0..=self.1).contains(point)).collect()
        };
        let room = hint.max_num_points().min(12);
        let finest = [of(&[1.0, 2.0, 5.0], 1), of(&[1.0], 1)].into_iter().find(|points| points.len() <= room);
        finest.unwrap_or_else(|| of(&[1.0], powers.clone().count().div_ceil(room.max(1))))
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.0..self.1
    }
}

impl ValueFormatter<f64> for LogAxis {
    fn format(value: &f64) -> String {
        // Ticks are 1, 2 or 5 times a power of ten.
        if (1e-4..1e6).contains(value) { format!("{}", (value * 1e6).round() / 1e6) } else { format!("{value:.0e}") }
    }
}

/// Logarithms of it exist.
fn is_drawable(point: &(f64, f64)) -> bool {
    [point.0, point.1].iter().all(|v| v.is_finite() && *v > 0.0)
}

/// The plots' own font: systems differ, and some have none.
fn set_font() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let font = include_bytes!("fonts/DejaVuSans-ascii.ttf");
        // Without it a PNG fails with the library's own message; the test below draws one.
        let _ = plotters::style::register_font("sans-serif", FontStyle::Normal, font);
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(f64, f64)>) -> Chart {
        let curve = Curve { name: "a & b".into(), points, marked: Some(1), look: Look::default() };
        Chart { title: "T".into(), x: "x, m".into(), y: "y".into(), curves: vec![curve] }
    }

    #[test]
    fn files_show_the_curve() {
        let directory = tempfile::tempdir().unwrap();
        let [svg, png] = ["a.svg", "a.png"].map(|name| directory.path().join(name));
        let chart = chart(vec![(0.5, 2.0), (1.0, 1.0), (f64::NAN, 1.0), (2.0, 3.0)]);
        chart.write_svg(&svg).unwrap();
        chart.write_png(&png).unwrap();
        let text = std::fs::read_to_string(&svg).unwrap();
        assert!(text.contains("x, m") && text.contains("a &amp; b"));
        assert_eq!(text.matches("<circle").count(), 3 + 1); // the points that are finite, and the ring
        let pixels = image::open(&png).unwrap().to_rgb8();
        assert_eq!(pixels.dimensions(), SIZE);
        let of_curve = pixels.pixels().filter(|p| p.0 == [0, 114, 178]).count();
        assert!(of_curve > 500, "{of_curve} pixels of the curve"); // a line of 2 pixels across most of 960
        let letters = pixels.rows().take(40).flatten().filter(|p| p.0[0] < 100).count();
        assert!(letters > 10, "{letters} dark pixels where the title stands");
    }

    #[test]
    fn axes_have_round_labels() {
        let room = |axis: LogAxis| axis.key_points(plotters::coord::ranged1d::LightPoints::new(1000, 1000));
        let labels = |axis| room(axis).iter().map(<LogAxis as ValueFormatter<f64>>::format).collect::<Vec<_>>();
        assert_eq!(labels(LogAxis(0.23, 3.1)), ["0.5", "1", "2"]);
        assert_eq!(labels(LogAxis(0.9e-3, 0.011)), ["0.001", "0.002", "0.005", "0.01"]);
        let wide = room(LogAxis(1e-20, 1e20));
        assert!((4..=12).contains(&wide.len()), "{wide:?}");
        assert_eq!(LogAxis(0.1, 10.0).map(&1.0, (0, 100)), 50);
    }

    #[test]
    fn nothing_to_draw_is_said() {
        let error = chart(vec![(0.0, 1.0), (1.0, f64::INFINITY)]).write_svg(Path::new("nowhere.svg")).unwrap_err();
        assert!(error.to_string().contains("no point"), "{error}");
        assert!(!Path::new("nowhere.svg").exists());
    }
}
