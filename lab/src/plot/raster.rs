//! Drawing on pixels, with text that needs no font of the system.
//!
//! Plotters' bitmap backend draws lines and areas. Text is Noto Sans, placed as the SVG backend places it, so
//! that the two pictures of a drawing agree.

use ab_glyph::{Font as _, FontRef, Glyph, PxScale, ScaleFont as _, point};
use anyhow::{Result, anyhow};
use plotters::prelude::{BitMapBackend, DrawingBackend, FontStyle};
use plotters::style::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingErrorKind,
};

/// A backend over rows of red, green and blue bytes.
pub(crate) struct Raster<'a> {
    inner: BitMapBackend<'a>,
    regular: FontRef<'static>,
    bold: FontRef<'static>,
}

impl<'a> Raster<'a> {
    /// Makes a backend that draws over a picture of this width and height.
    pub(crate) fn new(bytes: &'a mut [u8], size: (u32, u32)) -> Result<Self> {
        let inner = BitMapBackend::with_buffer_and_format(bytes, size);
        let font = |bytes| FontRef::try_from_slice(bytes).map_err(|error| anyhow!("{error}"));
        Ok(Self {
            inner: inner.map_err(|error| anyhow!("{error}"))?,
            regular: font(notosans::REGULAR_TTF)?,
            bold: font(notosans::BOLD_TTF)?,
        })
    }

    fn font<S: BackendTextStyle>(&self, style: &S) -> &FontRef<'static> {
        if matches!(style.style(), FontStyle::Bold) { &self.bold } else { &self.regular }
    }

    /// Returns the letters of a line that starts at the origin, its width, and the size of its font.
    fn lay_out<S: BackendTextStyle>(&self, text: &str, style: &S) -> (Vec<Glyph>, f32, f32) {
        let font = self.font(style);
        let em = narrow(style.size() / 1.24);
        let units = font.units_per_em().unwrap_or(1000.0);
        let font = font.as_scaled(PxScale::from(em * font.height_unscaled() / units));
        let (mut x, mut before) = (0.0, None);
        let mut glyphs = Vec::new();
        for c in text.chars() {
            let id = font.glyph_id(c);
            x += before.map_or(0.0, |before| font.kern(before, id));
            glyphs.push(id.with_scale_and_position(font.scale(), point(x, 0.0)));
            x += font.h_advance(id);
            before = Some(id);
        }
        (glyphs, x, em)
    }
}

impl DrawingBackend for Raster<'_> {
    type ErrorType = <BitMapBackend<'static> as DrawingBackend>::ErrorType;

    fn get_size(&self) -> (u32, u32) {
        self.inner.get_size()
    }

    fn ensure_prepared(&mut self) -> Result<(), DrawingErrorKind<Self::ErrorType>> {
        self.inner.ensure_prepared()
    }

    fn present(&mut self) -> Result<(), DrawingErrorKind<Self::ErrorType>> {
        self.inner.present()
    }

    fn draw_pixel(
        &mut self,
        point: BackendCoord,
        color: BackendColor,
    ) -> Result<(), DrawingErrorKind<Self::ErrorType>> {
        self.inner.draw_pixel(point, color)
    }

    fn draw_rect<S: BackendStyle>(
        &mut self,
        upper_left: BackendCoord,
        bottom_right: BackendCoord,
        style: &S,
        fill: bool,
    ) -> Result<(), DrawingErrorKind<Self::ErrorType>> {
        self.inner.draw_rect(upper_left, bottom_right, style, fill)
    }

    fn draw_text<S: BackendTextStyle>(
        &mut self,
        text: &str,
        style: &S,
        (x, y): BackendCoord,
    ) -> Result<(), DrawingErrorKind<Self::ErrorType>> {
        let (glyphs, width, em) = self.lay_out(text, style);
        let anchor = style.anchor();
        let left = match anchor.h_pos {
            HPos::Left => 0.0,
            HPos::Center => -0.5 * width,
            HPos::Right => -width,
        };
        // The height of a lower-case x is 0.54 of the font's size.
        let baseline = em
            * match anchor.v_pos {
                VPos::Top => 0.76,
                VPos::Center => 0.27,
                VPos::Bottom => -0.27,
            };
        let font = self.font(style);
        let mut ink = Vec::new();
        for mut glyph in glyphs {
            glyph.position += point(left, baseline);
            let Some(outline) = font.outline_glyph(glyph) else { continue };
            let corner = outline.px_bounds().min;
            let corner = (whole(corner.x), whole(corner.y));
            outline.draw(|dx, dy, coverage| {
                let (dx, dy) = (corner.0 + dx.cast_signed(), corner.1 + dy.cast_signed());
                ink.push((style.transform().transform(dx, dy), coverage));
            });
        }
        let color = style.color();
        let (width, height) = self.get_size();
        for ((dx, dy), coverage) in ink {
            let point = (x + dx, y + dy);
            let is_inside = (0..width.cast_signed()).contains(&point.0)
                && (0..height.cast_signed()).contains(&point.1);
            if is_inside && coverage > 0.0 {
                let alpha = color.alpha * f64::from(coverage.min(1.0));
                self.draw_pixel(point, BackendColor { alpha, ..color })?;
            }
        }
        Ok(())
    }

    fn estimate_text_size<S: BackendTextStyle>(
        &self,
        text: &str,
        style: &S,
    ) -> Result<(u32, u32), DrawingErrorKind<Self::ErrorType>> {
        let (_, width, em) = self.lay_out(text, style);
        Ok((whole(width.ceil()).unsigned_abs(), whole(em.ceil()).unsigned_abs()))
    }
}

#[expect(clippy::cast_possible_truncation, reason = "a picture is no million pixels wide")]
fn whole(length: f32) -> i32 {
    length as i32
}

#[expect(clippy::cast_possible_truncation, reason = "the size of a font")]
fn narrow(length: f64) -> f32 {
    length as f32
}
