//! Drawings from one description, as SVG and as PNG.
//!
//! ```text
//! Drawing --> plotters' SVG backend ------------------------> name.svg
//!         '-> Raster: pixels, 4 x 4 for each unit --average-> name.png, 2 x 2 for each unit
//! ```
//!
//! The raster is twice as large as the PNG, so that every edge is smooth. The PNG is twice as large as the
//! SVG's size, so that it is sharp on today's screens. Text uses a font in the program, so a machine without
//! fonts draws the same picture. An SVG names the font and leaves the rest to its reader.

mod axis;
mod chart;
mod raster;

use std::io::Write as _;
use std::path::Path;

use anyhow::{Result, anyhow};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

pub(crate) use axis::{Scale, Stops, number};
pub(crate) use chart::{HEADING, WORDS, Words, chart, heading};
pub(crate) use raster::Raster;

use crate::shade::Rgb;
use crate::{file, image};

/// The font of drawings, and its replacements in an SVG's reader.
const FONT: &str = "Noto Sans, DejaVu Sans, Helvetica, Arial, sans-serif";

/// Text, axes and grid lines, from dark to light.
pub(crate) const INK: RGBColor = RGBColor(0x22, 0x28, 0x30);
pub(crate) const MUTED: RGBColor = RGBColor(0x6a, 0x72, 0x7c);
pub(crate) const FAINT: RGBColor = RGBColor(0xd9, 0xdd, 0xe2);

/// Colours that differ for every kind of colour vision (Okabe and Ito 2008).
pub(crate) const COLORS: [RGBColor; 6] = [
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0xe6, 0x9f, 0x00),
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0x56, 0xb4, 0xe9),
];

/// An area for drawing.
pub(crate) type Area<B> = DrawingArea<B, Shift>;

/// The result of drawing on an area.
pub(crate) type AreaResult<B> = Result<(), DrawingAreaErrorKind<<B as DrawingBackend>::ErrorType>>;

/// A picture of lines, areas and words.
pub(crate) trait Drawing {
    /// Returns width and height, in units of a pixel of an ordinary screen.
    fn size(&self) -> (u32, u32);

    /// Draws on an area of that size, at the pen's scale.
    fn draw<B: DrawingBackend>(&self, area: &Area<B>, pen: Pen) -> AreaResult<B>;
}

/// A converter of units into pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pen {
    /// Pixels in a unit.
    pub(crate) scale: u32,
}

impl Pen {
    /// Returns a length in pixels.
    pub(crate) const fn px(self, units: u32) -> u32 {
        units * self.scale
    }

    /// Returns a coordinate in pixels.
    pub(crate) const fn at(self, units: i32) -> i32 {
        units * self.scale.cast_signed()
    }

    /// Returns the style of a line.
    pub(crate) fn line(self, color: impl Color, width: u32) -> ShapeStyle {
        color.stroke_width(self.px(width))
    }

    /// Returns the style of words whose left end is at the point; `size` is a size of CSS.
    pub(crate) fn text(self, size: u32, color: RGBColor) -> TextStyle<'static> {
        // Both the SVG backend and Raster divide by 1.24.
        let size = f64::from(self.px(size)) * 1.24;
        let font = FontDesc::new(FontFamily::Name(FONT), size, FontStyle::Normal);
        let pos = Pos::new(HPos::Left, VPos::Center);
        TextStyle { font, color: color.to_backend_color(), pos }
    }

    /// Returns the same style in bold.
    pub(crate) fn title(self, size: u32) -> TextStyle<'static> {
        let style = self.text(size, INK);
        TextStyle { font: style.font.style(FontStyle::Bold), ..style }
    }
}

/// Returns the style of words that are centred on the point.
pub(crate) fn centred(style: &TextStyle<'static>) -> TextStyle<'static> {
    style.pos(Pos::new(HPos::Center, VPos::Center))
}

/// Writes `name.svg` and `name.png` into a folder.
///
/// # Errors
/// The errors of writing the files.
pub(crate) fn save(drawing: &impl Drawing, folder: &Path, name: &str) -> Result<()> {
    let path = folder.join(name).with_extension("svg");
    let text = svg(drawing)?;
    file::write(&path, |file| file.write_all(text.as_bytes()))?;
    let (size, pixels) = pixels(drawing)?;
    image::write_png(&path.with_extension("png"), size, &pixels)
}

/// Returns the drawing as SVG.
///
/// # Errors
/// The errors of drawing.
pub(crate) fn svg(drawing: &impl Drawing) -> Result<String> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, drawing.size()).into_drawing_area();
        draw(drawing, &area, Pen { scale: 1 })?;
    }
    Ok(text)
}

/// Pixels for each unit of a PNG, and raster pixels for each of those, on each axis.
const SHARPNESS: u32 = 2;
const SMOOTHNESS: u32 = 2;

fn pixels(drawing: &impl Drawing) -> Result<((u32, u32), Vec<Rgb>)> {
    let pen = Pen { scale: SHARPNESS * SMOOTHNESS };
    let (width, height) = drawing.size();
    let fine = (pen.px(width), pen.px(height));
    let mut bytes = vec![0; 3 * fine.0 as usize * fine.1 as usize];
    {
        let area = Raster::new(&mut bytes, fine)?.into_drawing_area();
        draw(drawing, &area, pen)?;
    }
    let size = (SHARPNESS * width, SHARPNESS * height);
    Ok((size, averages(&bytes, size.0)))
}

fn draw<B: DrawingBackend>(drawing: &impl Drawing, area: &Area<B>, pen: Pen) -> Result<()> {
    let drawn = area.fill(&WHITE).and_then(|()| drawing.draw(area, pen));
    drawn.and_then(|()| area.present()).map_err(|error| anyhow!("cannot draw: {error}"))
}

/// Averages the pixels of a picture of this width from one that is `SMOOTHNESS` times as large.
fn averages(fine: &[u8], width: u32) -> Vec<Rgb> {
    let samples = SMOOTHNESS as usize;
    let line_bytes = 3 * samples * width as usize;
    let rows = fine.chunks_exact(samples * line_bytes).flat_map(|lines| {
        let mut sums = vec![[0_u32; 3]; width as usize];
        for line in lines.chunks_exact(line_bytes) {
            for (sum, colors) in sums.iter_mut().zip(line.chunks_exact(3 * samples)) {
                for [red, green, blue] in colors.as_chunks().0 {
                    sum[0] += u32::from(*red);
                    sum[1] += u32::from(*green);
                    sum[2] += u32::from(*blue);
                }
            }
        }
        sums
    });
    let average = |sum: u32| u8::try_from(sum / (SMOOTHNESS * SMOOTHNESS)).unwrap_or(u8::MAX);
    rows.map(|sums| sums.map(average)).collect()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// A black square in the middle, and a word above it.
    struct Square;

    impl Drawing for Square {
        fn size(&self) -> (u32, u32) {
            (20, 30)
        }

        fn draw<B: DrawingBackend>(&self, area: &Area<B>, pen: Pen) -> AreaResult<B> {
            let corners = [(pen.at(5), pen.at(10)), (pen.at(15), pen.at(20))];
            area.draw(&Rectangle::new(corners, BLACK.filled()))?;
            area.draw(&Text::new("Hm", (pen.at(10), pen.at(5)), centred(&pen.title(8))))
        }
    }

    #[test]
    fn both_files_show_the_drawing() {
        let folder = std::env::temp_dir().join(format!("hgrid-plot-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        save(&Square, &folder, "square").unwrap();
        let svg = fs::read_to_string(folder.join("square.svg")).unwrap();
        assert!(svg.contains("Hm") && svg.contains("<rect") && svg.contains("Noto Sans"), "{svg}");
        assert!(fs::read(folder.join("square.png")).unwrap().starts_with(b"\x89PNG"));
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn pixels_are_where_they_belong() {
        let ((width, height), pixels) = pixels(&Square).unwrap();
        assert_eq!((width, height), (40, 60));
        let at = |x: usize, y: usize| pixels[y * 40 + x];
        assert_eq!([at(20, 30), at(5, 30), at(20, 50)], [[0; 3], [255; 3], [255; 3]]);
        let letters = (0..20).flat_map(|y| (0..40).map(move |x| (x, y)));
        let dark = letters.filter(|&(x, y)| at(x, y)[0] < 128).count();
        assert!((40..200).contains(&dark), "{dark}");
    }
}
