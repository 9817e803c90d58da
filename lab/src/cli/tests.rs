//! Tests of the command line: words, and their parsed arguments.

use hgrid_core::Parameters;

use super::*;

#[test]
fn the_definition_is_sound() {
    Cli::command().debug_assert();
}

#[test]
fn bad_values_are_refused() {
    for words in [
        "render --size 0",
        "render --size 16385",
        "table a.ply --repeat 0",
        "render --view above",
        "render --eye 1,2",
        "render --target 1,2,3",
        "render --eye 1,2,3 --view top",
        "render --fov 0",
        "compare a.ply --eye 1,2,3 --view inside",
        "render --density many",
        "render --density 0",
        "render --density inf",
        "pack a.ply -o a.hgrid --density nan",
        "figures a.ply --densities 4,0",
        "render -o -",
        "render -o a.jpg",
        "pack a.ply -o -",
        "animate -o -",
        "figures a.ply -o -",
        "compare a.ply -o -",
        "compare a.ply --json -",
        "render --macrocell-factor 1",
        "render --depth 5",
        "render --method octree",
        "render --macrocell-factor -1",
        "table",
        "table a.ply --methods fixed,octree",
        "table a.ply --json --markdown",
        "compare",
        "compare a.ply --peers optix",
        "compare a.ply --instances 9 -o charts",
        "compare a.ply --instances many",
        "compare a.ply --spheres --instances 9",
        "compare a.ply --spheres -o charts",
        "render --samples 0",
        "pack a.ply",
        "validate",
        "animate --frames 0",
        "animate --threads 65",
        "render --threads 0",
    ] {
        let words = ["hgrid"].into_iter().chain(words.split(' '));
        assert!(Cli::try_parse_from(words.clone()).is_err(), "{:?}", words.collect::<Vec<_>>());
    }
}

/// The message names the range, and not how to write the name of a file that starts with a hyphen.
#[test]
fn negative_numbers_are_refused_by_their_range() {
    for words in [
        "render --ao -3",
        "render --samples -1",
        "render --threads -1",
        "render --size -1",
        "animate --frames -1",
        "compare a.ply --repeat -1",
        "compare a.ply --instances -1",
    ] {
        let words = ["hgrid"].into_iter().chain(words.split(' '));
        let message = Cli::try_parse_from(words).unwrap_err().to_string();
        assert!(
            message.contains("it is no whole number from") && !message.contains("-- -"),
            "{message}"
        );
    }
}

#[test]
fn numbers_that_are_not_whole_are_refused_by_their_range() {
    for (words, expected) in [
        ("render --size 1e9", "'1e9' for '--size <PIXELS>': it is no whole number from 1 to 16384"),
        ("render --size 1920x1080", "it is no whole number from 1 to 16384"),
        ("render --size 100000000000000000000", "it is no whole number from 1 to 16384"),
        ("render --threads 1.5", "it is no whole number from 1 to 64"),
        ("render --heat-top 0", "it is no whole number, 1 or more"),
        ("render --heat-top 5000000000", "it is no whole number from 1 to 4294967295"),
        ("render --depth two", "it is no whole number from 1 to 4"),
        ("render --depth 5", "it is no whole number from 1 to 4"),
        ("render --macrocell-factor 1", "it is no whole number, 2 or more"),
        ("table a.ply --repeat NaN", "it is no whole number from 1 to 1000"),
    ] {
        let words = ["hgrid"].into_iter().chain(words.split(' '));
        let message = Cli::try_parse_from(words).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
}

/// The help of an option names the limit that its parser has: it takes that number, and not the next one.
#[test]
fn the_help_names_limits() {
    let of_help = |command: &str, option: &str| {
        let cli = Cli::command();
        let command = cli.find_subcommand(command).unwrap();
        let mut options = command.get_arguments().filter_map(|it| Some((it.get_long()?, it)));
        let (_, argument) = options.find(|(long, _)| *long == option).unwrap();
        argument.get_help().unwrap().to_string()
    };
    for (words, limit) in [
        ("render --size 16385", "16384"),
        ("render --samples 1025", "1 to 1024"),
        ("render --ao 1025", "at most 1024"),
        ("render --threads 65", "1 to 64"),
        ("render --heat-top 0", "1 or more"),
        ("render --fov 121", "1 to 120"),
        ("render --density 0", "above 0"),
        ("render --macrocell-factor 1", "2 or more"),
        ("render --depth 5", "1 to 4"),
        ("pack --density 0", "above 0"),
        ("figures --densities 0", "above 0"),
        ("table --threads 65", "1 to 64"),
        ("table --repeat 1001", "1 to 1000"),
        ("animate --frames 100001", "1 to 100000"),
        ("animate --instances 10000001", "at most 10000000"),
        ("animate --threads 65", "1 to 64"),
        ("compare --repeat 1001", "1 to 1000"),
        ("compare --instances 10000001", "at most 10000000"),
    ] {
        let said: Vec<_> = ["hgrid"].into_iter().chain(words.split(' ')).collect();
        let error = Cli::try_parse_from(&said).unwrap_err();
        let is_value = matches!(error.kind(), ErrorKind::ValueValidation);
        assert!(is_value, "{words}: {error}");
        let help = of_help(said[1], said[2].trim_start_matches('-'));
        assert!(help.contains(limit), "{words}: {help}");
        // The small numbers are refused by the least number, the others by the greatest.
        let number: u32 = said[3].parse().unwrap();
        if number > 2 {
            let greatest = (number - 1).to_string();
            let words = [&said[..3], &[greatest.as_str()]].concat();
            let refused = Cli::try_parse_from(&words).err().map(|error| error.kind());
            assert_ne!(refused, Some(ErrorKind::ValueValidation), "{words:?}");
        }
    }
}

#[test]
fn a_misspelt_command_is_no_file() {
    let message = |words: &str| {
        let words = words.split(' ').map(OsString::from);
        Cli::of_words(words).unwrap_err().to_string()
    };
    for words in ["rendr one.obj", "rendr", "rendr --json"] {
        let said = message(words);
        let expected =
            "no command or file `rendr`, the nearest command is `render`; the commands are";
        assert!(said.contains(expected), "{said}");
    }
    for words in ["xyz one.obj", "xyz", "xyz --help", "frobnicate"] {
        let said = message(words);
        let word = words.split(' ').next().unwrap();
        let expected = format!("no command or file `{word}`; the commands are render, info, pack,");
        assert!(said.contains(&expected) && !said.contains("first-build"), "{said}");
    }
    let said = message("a.ply b.ply");
    assert!(said.contains("unexpected argument 'b.ply'"), "{said}");
    assert!(said.contains("one scene: `a.ply+b.ply` shows both"), "{said}");
    assert!(message("render a.ply b.ply").contains("shows both"));
    for other in ["a.ply --sise 9", "info a.ply b.ply"] {
        assert!(!message(other).contains("shows both"), "{other}");
    }
}

#[test]
fn without_a_command_a_scene_is_rendered() {
    let parse = |words: &str| {
        let words = words.split(' ').filter(|word| !word.is_empty()).map(OsString::from);
        Cli::of_words(words).map(|cli| cli.command)
    };
    for (words, expected) in [
        ("", DEFAULT_SCENE),
        ("bunny.ply", "bunny.ply"),
        ("--size 9 bunny.ply", "bunny.ply"),
        ("render bunny.ply --json", "bunny.ply"),
    ] {
        let Ok(Command::Render(args)) = parse(words) else { panic!("{words}") };
        assert_eq!(args.scene, expected);
    }
    assert!(matches!(parse("info a.ply"), Ok(Command::Info(_))));
    for words in ["--help", "help", "help render", "-V", "a.ply b.ply", "pack a.ply", "info"] {
        assert!(parse(words).is_err(), "{words}");
    }
}

#[test]
fn every_command_teaches_by_example() {
    let commands = Cli::command();
    for command in commands.get_subcommands().filter(|command| !command.is_hide_set()) {
        let mut command = command.clone();
        let help = command.render_help().to_string();
        let example = format!("  hgrid {}", command.get_name());
        let says_where = command.get_after_help().is_none();
        assert!(says_where || help.contains(&example), "{}", command.get_name());
    }
}

#[test]
fn parameters_of_others_are_refused() {
    let check = |words: &str| {
        TableArgs::parse_from(["hgrid", "a.ply"].into_iter().chain(words.split(' '))).race.check()
    };
    check("--depth 2").unwrap();
    check("--methods fixed,bvh --quality high --threads 2").unwrap();
    let message = check("--methods fixed --threads 2").unwrap_err().to_string();
    assert!(message.contains("--threads is for --methods bvh"), "{message}");
    let message = check("--methods fixed,bvh --depth 2").unwrap_err().to_string();
    assert!(message.contains("--depth is for --methods recursive"), "{message}");

    let compare = |words: &str| {
        CompareArgs::parse_from(["hgrid", "a.ply"].into_iter().chain(words.split(' '))).check()
    };
    compare("--quality high").unwrap();
    compare("--methods fixed,bvh --quality high").unwrap();
    let message = compare("--methods fixed --quality high").unwrap_err().to_string();
    assert!(message.contains("--quality is for --methods bvh"), "{message}");
}

/// Options that are refused together, wherever the error is found, end with the status of a wrong command line.
#[test]
fn options_without_effect_are_refused_with_the_words() {
    for (words, expected) in [
        ("a.ply --density 8", "--density is not for bvh"),
        ("a.ply --eye nan,0,0", "three finite numbers between commas"),
        ("a.ply --eye 1,2", "three finite numbers between commas"),
        ("a.ply --fov wide", "a number of degrees from 1 to 120"),
        ("a.ply --view above", "three-quarter or AZIMUTH,ELEVATION in degrees; some scenes have"),
        ("a.ply --target 1,2,3", "--eye <X,Y,Z>"),
        ("a.ply --eye 1,2,3 --target 1,2,3", "the same point"),
        ("table a.ply --eye 1,2,3 --target 1,2,3", "the same point"),
        ("animate a.ply --eye 1,2,3 --target 1,2,3", "the same point"),
        ("compare a.ply --eye 1,2,3 --target 1,2,3", "the same point"),
        ("a.ply --samples 4 --shading heat", "--samples is not for --shading heat"),
        ("pack a.ply -o a.hgrid --density 8", "--density is not for bvh"),
        ("pack a.ply -o a.c", "add --c-array NAME"),
        ("table a.ply --methods bvh --depth 1", "--depth is for --methods recursive"),
        ("figures a.ply --methods bvh", "add another of --methods"),
        ("figures a.ply --methods fixed --depth 1", "--depth is for --methods recursive"),
        ("animate --method fixed --refit", "--refit is for --method bvh"),
        ("animate --depth 1", "--depth is for --method recursive"),
        ("compare a.ply --methods fixed --quality high", "--quality is for --methods bvh"),
        ("compare a.ply --methods fixed --spheres", "add bvh to --methods"),
        ("compare a.ply --methods fixed --instances 2", "add bvh to --methods"),
    ] {
        let error = Cli::of_words(words.split(' ').map(OsString::from)).unwrap_err();
        assert_eq!(error.exit_code(), 2, "{words}");
        assert!(error.to_string().contains(expected), "{words}: {error}");
    }
}

#[test]
fn negative_values_are_values() {
    for words in
        ["--view -30,-20", "--eye -1,-2,-3 --target -1,0,0 --fov 60", "--view inside --fov 20.5"]
    {
        let words = ["hgrid", "render"].into_iter().chain(words.split(' '));
        Cli::try_parse_from(words).unwrap();
    }
}

#[test]
fn methods_have_their_names_and_all_compete_unless_some_are_named() {
    for &method in Method::ALL {
        let args = RenderArgs::parse_from(["hgrid", "--method", method.name()]);
        assert_eq!(args.config(), Config::new(method));
    }
    let methods = |words: &[&str]| -> Vec<Method> {
        let words = ["hgrid", "a.ply"].iter().chain(words);
        TableArgs::parse_from(words).race.configs().iter().map(Config::method).collect()
    };
    assert_eq!(methods(&[]), Method::ALL);
    assert_eq!(methods(&["--methods", "fixed,one-level"]), [Method::Fixed, Method::OneLevel]);
}

#[test]
fn parameters_reach_the_configuration() {
    let density = 2.0;
    for (words, expected) in [
        ("one-level --density 2", Parameters::OneLevel { density }),
        (
            "fixed --density 2 --macrocell-factor 4",
            Parameters::Fixed { density, macrocell_factor: 4 },
        ),
        (
            "variable --density 2 --subdivide-above 9",
            Parameters::Variable { density, subdivide_above: 9 },
        ),
        ("recursive --density 2 --depth 2", Parameters::Recursive { density, depth: 2 }),
        ("bvh --quality high", Parameters::Bvh { quality: Quality::High }),
    ] {
        let words = ["hgrid", "--method"].into_iter().chain(words.split(' '));
        assert_eq!(RenderArgs::parse_from(words).config(), expected.into());
    }
}
