//! Figure 1: build, render and time to image against density, one chart for each method.

use alloc::borrow::Cow;

use anyhow::{Context as _, Result, bail, ensure};
use hgrid_core::{Config, Parameters};
use plotters::coord::ranged1d::Ranged as _;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use serde::{Deserialize, Serialize};

use crate::cli::FiguresArgs;
use crate::machine::Machine;
use crate::measure::{Measurement, SceneFacts, rows};
use crate::notices::tell;
use crate::plot::{
    Area, AreaResult, COLORS, Drawing, HEADING, INK, MUTED, Pen, Scale, Stops, WORDS, Words, chart,
    heading, number,
};
use crate::progress::Progress;
use crate::regions::TOO_DENSE;
use crate::scene::Scene;
use crate::table::{display_name, measure_diffuse, times};

/// The reason why a method has no chart.
const SAME: &str = "all densities make the same grid";

/// The measurements of one scene at every density, for every method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Curves {
    machine: Machine,
    size: u16,
    repeats: u32,
    #[serde(flatten)]
    facts: SceneFacts,
    methods: Vec<Curve>,
}

/// The measurements of one method at every density.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Curve {
    method: Cow<'static, str>,
    default_density: f32,
    points: Vec<Measurement>,
}

impl Curves {
    /// Runs the race of all methods and densities.
    pub(super) fn measure(args: &FiguresArgs) -> Result<Self> {
        let Some(spec) = args.figure1.as_ref().or(args.scenes.first()) else {
            bail!("no scene for figure 1");
        };
        let (scene, spec) = (Scene::load(spec)?, spec.display());
        ensure!(!scene.indices.is_empty(), "`{spec}` has no triangles: nothing to measure");
        // Figure 2 prints the notices of its own scenes.
        if args.figure1.is_some() {
            tell(&scene);
        }
        let facts = SceneFacts::of(&scene);

        let race = &args.race;
        let configs = race.configs();
        let with_density =
            |config: &Config| Some((config.parameters, config.parameters.density()?));
        let methods: Vec<_> = configs.iter().filter_map(with_density).collect();
        let at_densities = |&(parameters, _): &(Parameters, f32)| {
            args.densities.iter().map(move |&density| parameters.with_density(density).into())
        };
        let configs: Vec<_> = methods.iter().flat_map(at_densities).collect();
        let mut progress =
            Progress::new("starting", rows(race.picture.size, configs.len(), race.repeat));
        progress.set_scope(&format!("figure 1, {}", display_name(&facts.scene)));
        let numbers = measure_diffuse(&scene, &configs, race, &mut progress)
            .with_context(|| format!("cannot measure `{spec}`"))?;

        let curves = methods.iter().zip(numbers.chunks(args.densities.len()));
        let curves = curves.map(|(&(parameters, default_density), points)| Curve {
            method: parameters.method().name().into(),
            default_density,
            points: points.to_vec(),
        });
        Ok(Self {
            machine: Machine::here(),
            size: race.picture.size,
            repeats: race.repeat,
            facts,
            methods: curves.collect(),
        })
    }
}

impl Curves {
    /// Refuses charts without a point.
    ///
    /// # Errors
    /// If the mesh can have none of the densities, or all make the same grids of it.
    pub(super) fn check(&self) -> Result<()> {
        ensure!(
            self.methods.iter().any(|curve| curve.points().next().is_some()),
            "figure 1 would show nothing, because {TOO_DENSE}: name smaller --densities"
        );
        ensure!(
            self.have_points(),
            "figure 1 would show nothing, because {SAME}: name a larger scene, or densities that differ more"
        );
        Ok(())
    }

    pub(super) fn have_points(&self) -> bool {
        self.curves().flat_map(Curve::points).next().is_some()
    }

    /// Returns the methods that have a chart.
    fn curves(&self) -> impl Iterator<Item = &Curve> {
        self.methods.iter().filter(|curve| curve.is_curve())
    }

    /// Returns a line for each reason to leave methods or densities out of the charts; none if they show all.
    pub(super) fn notes(&self) -> Vec<String> {
        let is_flat = |curve: &&Curve| !curve.is_curve() && curve.left_out().is_none();
        let flat = self.methods.iter().filter(is_flat).map(|curve| &*curve.method);
        let flat: Vec<_> = flat.collect();
        let too_dense: Vec<_> = self.methods.iter().filter_map(Curve::left_out).collect();
        let reasons = [(SAME, flat.join(", ")), (TOO_DENSE, too_dense.join("; "))];
        let reasons = reasons.into_iter().filter(|(_, what)| !what.is_empty());
        reasons.map(|(why, what)| format!("left out of figure 1, because {why}: {what}")).collect()
    }
}

impl Curve {
    /// Returns true if the density makes a difference to the method.
    fn is_curve(&self) -> bool {
        let first = self.points.first().map(|point| point.resolution);
        self.points.len() < 2 || self.points.iter().any(|point| Some(point.resolution) != first)
    }

    /// Returns the points whose grids are as dense as they were configured to be.
    fn points(&self) -> impl Iterator<Item = &Measurement> {
        self.points.iter().filter(|point| point.density >= point.configured_density)
    }

    /// Returns the other densities, with the name of the method; nothing if there are none.
    fn left_out(&self) -> Option<String> {
        let thinner = self.points.iter().filter(|point| point.density < point.configured_density);
        let densities: Vec<_> =
            thinner.filter_map(|point| Some(point.configured_density?.to_string())).collect();
        (!densities.is_empty()).then(|| format!("{} {}", self.method, densities.join(", ")))
    }
}

/// The three times of a measurement: name, colour, value.
type Time = (&'static str, RGBColor, fn(&Measurement) -> f64);

const TIMES: [Time; 3] = [
    ("time to image", INK, |m| m.time_to_image_seconds),
    ("render", COLORS[0], |m| m.render_seconds),
    ("build", COLORS[3], |m| m.build_seconds),
];

/// The charts of figure 1.
pub(super) struct Figure<'a>(pub(super) &'a Curves);

/// Units of a chart.
const WIDTH: u32 = 520;
const HEIGHT: u32 = 400;

impl Figure<'_> {
    fn curves(&self) -> Vec<&Curve> {
        self.0.curves().collect()
    }

    /// Returns the number of columns and of rows of charts.
    fn grid(&self) -> (u32, u32) {
        let count = u32::try_from(self.curves().len()).unwrap_or(u32::MAX).max(1);
        let columns = if count <= 3 { count } else { count.div_ceil(2) };
        (columns, count.div_ceil(columns))
    }

    /// Returns the axes of all charts: powers of two, and times.
    fn axes(&self) -> (Stops, Scale) {
        let curves = self.curves();
        let points = || curves.iter().flat_map(|curve| curve.points());
        let seconds = points().flat_map(|point| TIMES.map(|(_, _, time)| time(point)));
        let mut names: Vec<_> = points()
            .filter_map(|point| point.configured_density.map(f64::from))
            .map(|density| (density.log2(), number(density)))
            .collect();
        names.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        names.dedup();
        let ends = (names.first(), names.last());
        let (low, high) =
            ends.0.zip(ends.1).map_or((0.0, 1.0), |((low, _), (high, _))| (*low, *high));
        (Stops { range: low - 0.3..high + 0.3, names }, Scale::fitting(seconds, 0.08))
    }
}

impl Drawing for Figure<'_> {
    fn size(&self) -> (u32, u32) {
        let (columns, rows) = self.grid();
        (columns.max(2) * WIDTH, HEADING + rows * HEIGHT)
    }

    fn draw<B: DrawingBackend>(&self, area: &Area<B>, pen: Pen) -> AreaResult<B> {
        let Curves { machine, size, repeats, facts, .. } = self.0;
        let name = display_name(&facts.scene);
        let title = format!("Times against grid density: {name}, {size} x {size} rays");
        let legend = TIMES.map(|(name, color, _)| (name.to_owned(), color));
        let source = format!("{}; {}", machine.summary(1), times(*repeats));
        heading(area, pen, [&title, &source], &legend)?;

        let (_, below) = area.split_vertically(pen.px(HEADING));
        let (columns, rows) = self.grid();
        let charts = below.split_evenly((rows as usize, columns as usize));
        for (curve, area) in self.curves().iter().zip(&charts) {
            curve.draw(area, pen, self.axes())?;
        }
        Ok(())
    }
}

impl Curve {
    fn draw<B: DrawingBackend>(
        &self,
        area: &Area<B>,
        pen: Pen,
        axes: (Stops, Scale),
    ) -> AreaResult<B> {
        let words = Words { title: &self.method, x: "density (cells per triangle)", y: "seconds" };
        let x = f64::from(self.default_density).log2();
        let range = axes.1.range();
        let is_shown = axes.0.range.contains(&x);
        let mut chart = chart(area, pen, words, axes)?;

        // Mark the default density.
        if is_shown {
            let ends = [(x, range.start), (x, range.end)];
            let dash = DashedPathElement::new(ends, pen.px(4), pen.px(4), pen.line(MUTED, 1));
            chart.draw_series([dash])?;
            let style = pen.text(WORDS, MUTED).pos(Pos::new(HPos::Right, VPos::Top));
            let label = format!("default: {}", self.default_density);
            let place = chart.backend_coord(&(x, range.end));
            let (left, top) = area.get_base_pixel();
            let place = (place.0 - left - pen.at(6), place.1 - top + pen.at(6));
            area.draw(&Text::new(label, place, style))?;
        }

        for (_, color, time) in TIMES {
            let points = self.points();
            let place = |m: &Measurement| Some((f64::from(m.configured_density?).log2(), time(m)));
            let points: Vec<_> = points.filter_map(place).collect();
            let dot = |&point: &(f64, f64)| Circle::new(point, pen.px(4), color.filled());
            chart.draw_series([PathElement::new(points.clone(), pen.line(color, 2))])?;
            chart.draw_series(points.iter().map(dot))?;
        }
        Ok(())
    }
}
