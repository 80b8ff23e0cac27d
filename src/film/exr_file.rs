//! EXR: linear float32, lossless ZIP compression, settings as attributes, further channels beside R, G and B.
//!
//! The same image and settings give the same bytes: the library writes attributes of our own in a hash map's order,
//! so all settings go into one standard attribute, `comments`.

use std::io::{self, Cursor, Seek, Write};
use std::path::Path;

use exr::prelude as exr;
use exr::{ReadChannels, ReadLayers, WritableImage};

use super::{Channel, Image, SaveOptions, check_pixel_count, unreadable};
use crate::error::{Error, Result};

const RGB: [&str; 3] = ["R", "G", "B"];

/// What an EXR file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrFile {
    /// Channels R, G and B.
    pub image: Image,
    /// All others, sorted by name.
    pub channels: Vec<Channel>,
    /// The `name = value` lines of the `comments` attribute, in order.
    pub settings: Vec<(String, String)>,
}

/// Reads an EXR file with all its channels and settings: the first layer that has R, G and B, at full resolution;
/// half floats and integers become float32. Values are as in the file, NaN included.
///
/// # Errors
/// [`Error::Usage`] naming the file and what is wrong with it.
pub fn load_exr(path: &Path) -> Result<ExrFile> {
    let bytes = std::fs::read(path).map_err(|error| unreadable(path, error))?;
    read(path, &bytes)
}

/// Demands names that the format can tell apart, one finite sample a pixel each.
pub(super) fn check_channels(image: &Image, channels: &[Channel]) -> Result<()> {
    for (i, channel) in channels.iter().enumerate() {
        let name = &channel.name;
        let taken = RGB.contains(&name.as_str()) || channels[..i].iter().any(|other| other.name == *name);
        let problem = if taken || name.is_empty() || name.len() > 255 {
            "expected a name of its own of 1 to 255 bytes".to_owned()
        } else if channel.samples.len() != image.pixels.len() {
            format!("{} samples for {} pixels", channel.samples.len(), image.pixels.len())
        } else {
            match channel.samples.iter().filter(|sample| !sample.is_finite()).count() {
                0 => continue,
                bad => format!("{bad} of {} samples are NaN or infinite", channel.samples.len()),
            }
        };
        return Err(Error::Failed(format!("image channel '{name}': {problem}")));
    }
    Ok(())
}

/// Writes an image whose channels were checked.
pub(super) fn write(image: &Image, options: &SaveOptions, file: &mut (impl Write + Seek)) -> io::Result<()> {
    let plane = |name: &str, samples: Vec<f32>| exr::AnyChannel::new(text(name), exr::FlatSamples::F32(samples));
    let rgb = RGB.iter().enumerate().map(|(c, name)| plane(name, image.pixels.iter().map(|pixel| pixel[c]).collect()));
    let further = options.channels.iter().map(|channel| plane(&channel.name, channel.samples.clone()));

    let mut attributes = exr::LayerAttributes { software_name: Some(text("photile")), ..Default::default() };
    if !options.settings.is_empty() {
        // A line a setting: a newline in a value (a file name may hold one) must not start another.
        let line = |(name, value): &(String, String)| format!("{name} = {}\n", value.replace(['\n', '\r'], " "));
        attributes.comments = Some(text(&options.settings.iter().map(line).collect::<String>()));
    }
    let encoding = exr::Encoding {
        compression: exr::Compression::ZIP16,
        blocks: exr::Blocks::ScanLines,
        line_order: exr::LineOrder::Increasing,
    };
    let channels = exr::AnyChannels::sort(rgb.chain(further).collect());
    let layer = exr::Layer::new((image.width as usize, image.height as usize), attributes, encoding, channels);
    exr::Image::from_layer(layer).write().to_buffered(file).map_err(io::Error::other)
}

/// Reads what [`load_exr`] describes from a file's bytes; `path` is for messages.
pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<ExrFile> {
    // Sizes first: the decoder allocates what the header says.
    let chunks = ::exr::block::read(Cursor::new(bytes), false).map_err(|error| unreadable(path, error))?;
    for header in chunks.headers() {
        check_pixel_count(path, header.layer_size.width() as u64, header.layer_size.height() as u64)?;
    }
    let file = exr::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_chunks(chunks)
        .map_err(|error| unreadable(path, error))?;

    let channel = |layer: &ColorLayer, name: &str| layer.channel_data.list.iter().position(|found| found.name.eq(name));
    let layers = file.layer_data.iter();
    let Some((layer, rgb)) = layers.clone().find_map(|layer| {
        let [r, g, b] = RGB.map(|name| channel(layer, name));
        Some((layer, [r?, g?, b?]))
    }) else {
        let names = layers.flat_map(|layer| &layer.channel_data.list).map(|found| found.name.to_string());
        let found = names.collect::<Vec<_>>().join(", ");
        return Err(unreadable(path, format!("expected channels R, G and B, found {found}")));
    };
    let (width, height) = layer.size.into();
    let list = &layer.channel_data.list;
    if let Some(coarse) = list.iter().find(|found| found.sample_data.len() != width * height) {
        return Err(unreadable(path, format!("channel {} is subsampled, expected a sample a pixel", coarse.name)));
    }

    let plane = |i: usize| list[i].sample_data.values_as_f32();
    let pixels = plane(rgb[0]).zip(plane(rgb[1])).zip(plane(rgb[2])).map(|((r, g), b)| [r, g, b]).collect();
    let further = (0..list.len()).filter(|i| !rgb.contains(i));
    let further = further.map(|i| Channel { name: list[i].name.to_string(), samples: plane(i).collect() });
    let comments = layer
        .attributes
        .comments
        .as_ref()
        .map_or(String::new(), |text| String::from_utf8_lossy(text.as_slice()).into_owned());
    let settings = comments.lines().filter_map(|line| line.split_once(" = "));
    Ok(ExrFile {
        image: Image::from_pixels(width as u32, height as u32, pixels).map_err(|error| unreadable(path, error))?,
        channels: further.collect(),
        settings: settings.map(|(name, value)| (name.to_owned(), value.to_owned())).collect(),
    })
}

type ColorLayer = exr::Layer<exr::AnyChannels<exr::FlatSamples>>;

/// The format's text is bytes; ours are UTF-8.
fn text(string: &str) -> exr::Text {
    exr::Text::from_slice_unchecked(string.as_bytes())
}
