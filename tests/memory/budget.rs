//! Grids for a memory budget: as fine as fits.

use hgrid_core::{Block, Config, Error, Grid, Method, Region, fit, sizes};
use hgrid_tests::meshes::{Mesh, ball};
use hgrid_tests::methods::configs;

/// The configuration whose grid has one step more cells than this one; none for the finest.
fn a_step_finer(finest: &Config, fitted: &Config) -> Option<Config> {
    let density = finest.parameters.density()?;
    let (mut fewer, mut finer) = (1.0, None);
    while fewer > 0.0 {
        let coarser = (f64::from(density) * fewer) as f32;
        if fitted.parameters.density() == Some(coarser) {
            return finer;
        }
        finer = Some(Config { parameters: finest.parameters.with_density(coarser), ..*finest });
        fewer *= std::f64::consts::FRAC_1_SQRT_2;
    }
    panic!("{fitted:?} is no coarser {finest:?}");
}

#[test]
fn the_finest_grid_that_fits_is_built_in_its_budget() {
    let mesh = ball(40, 1.0);
    let view = mesh.view();
    for config in configs() {
        let enough = sizes(&view, &config, &mut []).unwrap();
        let mut scratch = vec![Block::ZERO; Block::count_for(enough.scratch_bytes)];
        let scratch = Block::bytes_mut(&mut scratch);
        let whole = sizes(&view, &config, scratch).unwrap().index_bytes;
        assert_eq!(fit(&view, &config, whole, scratch).unwrap().0, config);
        assert_eq!(fit(&view, &config, usize::MAX, scratch).unwrap().0, config);

        let has_dial = config.parameters.density().is_some();
        let mut last = whole;
        for budget in [whole - 1, whole * 9 / 10, whole * 3 / 4] {
            let (fitted, needed) = match fit(&view, &config, budget, scratch) {
                Ok(fitted) => {
                    assert!(fitted.1.index_bytes <= budget, "{config:?}: {budget}");
                    fitted
                }
                Err(error) => {
                    let Error::OutOfMemory { region: Region::Index, needed_bytes, .. } = error
                    else {
                        panic!("{error}");
                    };
                    // The size that the error asks for is enough.
                    fit(&view, &config, needed_bytes as usize, scratch).unwrap()
                }
            };
            assert_eq!(sizes(&view, &fitted, scratch), Ok(needed));
            if let Some(finer) = a_step_finer(&config, &fitted) {
                let finer = sizes(&view, &finer, scratch).ok().map(|finer| finer.index_bytes);
                let most = budget.max(needed.index_bytes);
                assert!(finer.is_none_or(|bytes| bytes > most), "{fitted:?} in {most} bytes");
            }
            assert!(has_dial || fitted == config && needed.index_bytes == whole);
            assert!(needed.index_bytes <= last, "{config:?}: {budget}");
            last = needed.index_bytes;
            let mut index = vec![Block::ZERO; Block::count_for(needed.index_bytes)];
            let index = Block::bytes_mut(&mut index);
            Grid::build(view, &fitted, &mut index[..needed.index_bytes], scratch).unwrap();
        }
        // Every grid is larger than its header, so 100 bytes never suffice.
        let error = fit(&view, &config, 100, scratch).unwrap_err();
        // A method with coarser grids asks for less than the whole.
        let most = whole - usize::from(has_dial);
        let is_told = matches!(
            error,
            Error::OutOfMemory { region: Region::Index, needed_bytes, available_bytes: 100 }
                if needed_bytes > 100 && needed_bytes <= most as u64
        );
        assert!(is_told, "{config:?}: {error}");
    }
    // A density too high to build at all counts as too large, not as invalid.
    for config in configs().filter(|config| config.method() != Method::Bvh) {
        let finer = Config::from(config.parameters.with_density(1e9));
        let enough = sizes(&view, &config, &mut []).unwrap();
        let mut scratch = vec![Block::ZERO; 2 * Block::count_for(enough.scratch_bytes)];
        let scratch = Block::bytes_mut(&mut scratch);
        let budget = 12 * mesh.indices.len();
        let (fitted, needed) = fit(&view, &finer, budget, scratch).unwrap();
        assert!(needed.index_bytes <= budget, "{config:?}");
        assert!(fitted.parameters.density() < Some(1e9), "{fitted:?}");
        let finer = a_step_finer(&finer, &fitted).expect("a coarser one fits");
        let finer = sizes(&view, &finer, scratch).ok().map(|finer| finer.index_bytes);
        assert!(finer.is_none_or(|bytes| bytes > budget), "{fitted:?} in {budget} bytes");
    }
    let nothing = Mesh::default();
    for config in configs() {
        let enough = sizes(&nothing.view(), &config, &mut []).unwrap();
        let mut scratch = vec![Block::ZERO; Block::count_for(enough.scratch_bytes)];
        let scratch = Block::bytes_mut(&mut scratch);
        assert_eq!(fit(&nothing.view(), &config, 1 << 24, scratch).unwrap().0, config);
        let without = fit(&mesh.view(), &config, usize::MAX, &mut []);
        let needs_scratch = !matches!(config.method(), Method::OneLevel | Method::Fixed);
        let is_asked_for =
            matches!(without, Err(Error::OutOfMemory { region: Region::Scratch, .. }));
        assert_eq!(is_asked_for, needs_scratch, "{config:?}: {without:?}");

        // If the scratch is too small to plan a grid, `fit` takes a coarser one that can be planned.
        let enough = sizes(&mesh.view(), &config, &mut []).unwrap().scratch_bytes;
        let mut scratch = vec![Block::ZERO; Block::count_for(enough)];
        for bytes in [enough - 64, enough / 8 * 7, enough / 2, enough / 8] {
            let scratch = &mut Block::bytes_mut(&mut scratch)[..bytes];
            match fit(&mesh.view(), &config, usize::MAX, scratch) {
                Ok((_, needed)) => {
                    assert!(needed.is_exact || !needs_scratch, "{config:?}: {bytes} of {enough}");
                }
                Err(Error::OutOfMemory { region: Region::Scratch, needed_bytes, .. }) => {
                    assert!(needs_scratch && needed_bytes > bytes as u64, "{config:?}");
                }
                Err(error) => panic!("{config:?}: {error}"),
            }
        }
    }
}
