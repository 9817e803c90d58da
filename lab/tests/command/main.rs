//! `hgrid` as a program: its arguments, files and exit statuses, run as by a shell.

#[cfg(target_os = "linux")]
mod outputs;

use std::fs;
use std::io;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

/// A temporary folder with a mesh in it.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> io::Result<Self> {
        let folder =
            std::env::temp_dir().join(format!("hgrid-command-{name}-{}", std::process::id()));
        fs::create_dir_all(&folder)?;
        fs::write(
            folder.join("a.obj"),
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3 4\nf 1 2 4\n",
        )?;
        Ok(Self(folder))
    }

    /// The command in the folder.
    fn command(&self, words: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hgrid"));
        command.current_dir(&self.0).args(words.split_whitespace());
        command
    }

    /// Runs the command in the folder.
    fn hgrid(&self, words: &str) -> io::Result<Output> {
        self.command(words).output()
    }

    /// Returns the output of a command that succeeds.
    fn says(&self, words: &str) -> io::Result<String> {
        let output = self.hgrid(words)?;
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{words}: {error}");
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    }

    /// Returns the message of a command that fails.
    fn fails(&self, words: &str) -> io::Result<String> {
        let output = self.hgrid(words)?;
        assert!(!output.status.success() && output.stdout.is_empty(), "{words}");
        Ok(String::from_utf8_lossy(&output.stderr).into_owned())
    }

    /// Returns the message of a command whose words are refused, and which leaves the folder as it is.
    fn refuses(&self, words: &str) -> io::Result<String> {
        let names = || fs::read_dir(&self.0).map(Iterator::count);
        let before = names()?;
        let message = self.fails(words)?;
        assert_eq!(self.hgrid(words)?.status.code(), Some(2), "{words}");
        assert_eq!(names()?, before, "{words}");
        Ok(message)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[test]
fn a_blob_overwrites_none_of_its_sources() {
    let folder = Folder::new("sources").unwrap();
    folder.says("pack a.obj -o a.hgrid").unwrap();
    for scene in ["a.hgrid", "./a.hgrid", "a.hgrid+a.obj", "a.obj+a.hgrid"] {
        let said = folder.fails(&format!("pack {scene} -o a.hgrid")).unwrap();
        assert!(said.contains("would be overwritten"), "{scene}: {said}");
    }
    folder.says("validate a.hgrid").unwrap();
    fs::copy(folder.0.join("a.hgrid"), folder.0.join("x+y.hgrid")).unwrap();
    let said = folder.fails("pack x+y.hgrid+a.obj -o x+y.hgrid").unwrap();
    assert!(said.contains("`x+y.hgrid` would be overwritten"), "{said}");
    folder.says("pack a.hgrid -o b.hgrid").unwrap();
    // A glTF file names its buffer, with spaces as %20. It may have any name, and be binary.
    let json = r#"{ "asset": { "version": "2.0" }, "buffers": [{ "uri": "b%20c.bin", "byteLength": 4 }] }"#;
    let json = format!("{json:92}");
    let length = |bytes: u32| bytes.to_le_bytes();
    let head = [&b"glTF\x02\0\0\0"[..], &length(112), &length(92), b"JSON"].concat();
    let files = [("b.gltf", Vec::new()), ("b", Vec::new()), ("b.glb", head.clone()), ("c", head)];
    for (name, head) in files {
        fs::write(folder.0.join(name), [head, json.clone().into_bytes()].concat()).unwrap();
        fs::write(folder.0.join("b c.bin"), "data").unwrap();
        let output = ["pack", name, "-o", "b c.bin"];
        let command = Command::new(env!("CARGO_BIN_EXE_hgrid"))
            .current_dir(&folder.0)
            .args(output)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&command.stderr).into_owned();
        assert!(said.contains(&format!("`b c.bin` holds a part of `{name}`")), "{said}");
        assert_eq!(fs::read(folder.0.join("b c.bin")).unwrap(), b"data");
    }
}

#[test]
fn results_overwrite_no_mesh() {
    let folder = Folder::new("results").unwrap();
    folder.says("pack a.obj -o blob").unwrap();
    for (words, expected) in [
        (
            "--json a.obj procedural:knot:500",
            "`a.obj` is named like a mesh: give --json a name like x.json",
        ),
        ("blob --json ./blob", "`blob` would be overwritten by its own results"),
        ("a.obj a.obj+blob --json blob", "`blob` would be overwritten by its own results"),
    ] {
        let said = folder.fails(&format!("compare {words}")).unwrap();
        assert!(said.contains(expected), "{words}: {said}");
    }
    folder.says("validate blob").unwrap();
}

#[test]
fn a_picture_overwrites_none_of_its_sources() {
    let folder = Folder::new("pictures").unwrap();
    folder.says("pack a.obj -o blob").unwrap();
    for scene in ["blob", "./blob", "a.obj+blob"] {
        let said = folder.fails(&format!("{scene} --size 16 -o blob")).unwrap();
        assert!(said.contains("would be overwritten by its own picture"), "{scene}: {said}");
    }
    folder.says("validate blob").unwrap();
}

#[test]
fn a_file_alone_is_rendered() {
    let folder = Folder::new("render").unwrap();
    let text = folder.says("a.obj --size 16").unwrap();
    assert!(text.contains("3 triangles") && text.contains("wrote hgrid.png"), "{text}");
    assert!(folder.0.join("hgrid.png").exists());
    let json = folder.says("render a.obj --size 16 --samples 2 --json -o other.png").unwrap();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!((&json["triangles"], &json["samples"]), (&3.into(), &2.into()));

    assert!(folder.fails("a.obj -o a.jpg").unwrap().contains("name it a.png"));
    assert!(folder.fails("nothing.ply").unwrap().contains("cannot open it"));
    assert!(folder.fails("nothing").unwrap().contains("no command or file `nothing`"));
    assert!(folder.fails("render nothing").unwrap().contains("no scene `nothing`"));
    assert!(folder.fails("rendr a.obj").unwrap().contains("the nearest command is `render`"));
    assert!(folder.fails("report nope").unwrap().contains("`nope` is no checkout of hgrid"));
    fs::write(folder.0.join("empty.ply"), "").unwrap();
    fs::write(folder.0.join("empty.obj"), "").unwrap();
    for words in
        ["empty.ply", "empty.obj", "info empty.ply", "info empty.obj", "validate empty.ply"]
    {
        assert!(folder.fails(words).unwrap().contains("`: it is empty"), "{words}");
    }
    assert!(
        folder
            .fails("hgrid.png")
            .unwrap()
            .contains("it is a PNG picture: a mesh is read from .ply")
    );
    assert!(
        folder
            .fails("table a.obj --methods bvh --depth 2")
            .unwrap()
            .contains("--depth is for --methods recursive")
    );
}

#[test]
fn a_missing_folder_is_named_before_the_work() {
    let folder = Folder::new("missing").unwrap();
    for (words, expected) in [
        ("a.obj -o no/a.png", "cannot write `no/a.png`: there is no folder `no`: make it"),
        ("a.obj -o .", "cannot write `.`: it is a folder: name a file in it"),
        ("pack a.obj -o no/a.hgrid", "there is no folder `no`: make it"),
        ("pack a.obj -o a.obj/a.hgrid", "`a.obj` is a file: name a folder in its place"),
        ("animate a.obj -o a.obj", "cannot write into `a.obj`: it is a file: name a folder"),
        ("figures a.obj -o a.obj", "cannot write into `a.obj`: it is a file: name a folder"),
    ] {
        let said = folder.fails(words).unwrap();
        assert!(said.contains(expected), "{words}: {said}");
    }
}

#[test]
fn an_animation_needs_triangles_and_makes_no_folder_without() {
    let folder = Folder::new("still").unwrap();
    fs::write(folder.0.join("points.obj"), "v 0 0 0\n").unwrap();
    for (words, expected) in [
        ("points.obj", "`points.obj` has no triangles: nothing to animate"),
        ("a.obj --method fixed --refit", "--refit is for --method bvh: ask for that"),
        ("a.obj --refit", "--refit is for later frames than the first: ask for --frames 2"),
        ("a.obj --method fixed --instances 2", "--instances is for --method bvh: ask for that"),
        ("a.obj --view close", "`a.obj` has no view `close`"),
    ] {
        let said = folder.fails(&format!("animate {words} --frames 1 --size 9 -o frames")).unwrap();
        assert!(said.contains(expected), "{words}: {said}");
    }
    assert!(!folder.0.join("frames").exists());
}

#[test]
fn an_animation_that_shows_nothing_is_an_error() {
    let folder = Folder::new("unseen").unwrap();
    for words in ["", "--instances 4", "--method fixed"] {
        let words =
            format!("animate a.obj {words} --frames 2 --size 9 --eye 9,9,9 --target 99,9,9");
        let said = folder.fails(&words).unwrap();
        let expected = "cannot animate `a.obj`: no ray hits anything; look from elsewhere";
        assert!(said.contains(expected), "{words}: {said}");
    }
}

#[test]
fn what_is_no_file_is_refused() {
    let folder = Folder::new("kinds").unwrap();
    for command in ["info", "render", "validate"] {
        let said = folder.fails(&format!("{command} .")).unwrap();
        assert!(said.contains("it is a folder: name a file in it"), "{command}: {said}");
    }
    if cfg!(unix) {
        let made = Command::new("mkfifo").current_dir(&folder.0).arg("pipe").status().unwrap();
        assert!(made.success());
        for file in ["/dev/null", "pipe"] {
            let said = folder.fails(&format!("info {file}")).unwrap();
            let expected = "it is a pipe or a device: write what it holds into a file";
            assert!(said.contains(expected), "{said}");
        }
    }
}

/// The name of a file need not be text: output shows what can be shown of it.
#[cfg(target_os = "linux")]
#[test]
fn a_name_that_is_no_text_names_a_file() {
    use std::os::unix::ffi::OsStrExt as _;
    let folder = Folder::new("names").unwrap();
    let name = std::ffi::OsStr::from_bytes(b"caf\xe9.obj");
    fs::copy(folder.0.join("a.obj"), folder.0.join(name)).unwrap();
    for (options, expected) in [
        ("render --size 16", "caf\u{fffd}.obj: 3 triangles"),
        ("info --json", "\"file\": \"caf\u{fffd}.obj\""),
        ("pack -o a.hgrid", "wrote a.hgrid"),
        ("animate --size 16 --frames 1", "caf\u{fffd}.obj: 3 triangles"),
        ("table --size 16 --repeat 1 --methods bvh", "caf\u{fffd}"),
        ("table --size 16 --repeat 1 --methods bvh --json", "caf\u{fffd}.obj"),
        ("figures --size 16 --repeat 1 --methods fixed --densities 4", "figure2"),
        ("first-build --instances 2", "seconds"),
    ] {
        let (program, mut words) = (env!("CARGO_BIN_EXE_hgrid"), options.split(' '));
        let mut command = Command::new(program);
        let command = command.current_dir(&folder.0).args(words.next()).arg(name).args(words);
        let command = if options.starts_with("first") { command.arg("bvh") } else { command };
        let output = command.output().unwrap();
        let [said, error] =
            [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
        assert!(output.status.success() && said.contains(expected), "{options}: {said} {error}");
    }
}

/// A full disk is an error with a message and a status, even if the message finds no room either.
#[cfg(target_os = "linux")]
#[test]
fn a_full_output_is_an_error() {
    let folder = Folder::new("full").unwrap();
    let full = || fs::File::options().write(true).open("/dev/full").unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_hgrid"));
    let command = command.current_dir(&folder.0).args(["info", "a.obj"]);
    let output = command.stdout(full()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1));
    assert!(said.starts_with("error: cannot write to standard output: "), "{said}");
    let output = command.stdout(full()).stderr(full()).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn packed_files_are_described_proved_and_rendered() {
    let folder = Folder::new("pack").unwrap();
    let facts = folder.says("info a.obj").unwrap();
    assert!(facts.contains("OBJ") && facts.contains("0 0 0  to  1 1 1"), "{facts}");
    for (options, quality) in [
        ("", "fast".into()),
        ("--method one-level --density 2", serde_json::Value::Null),
        ("--quality high", "high".into()),
    ] {
        folder.says(&format!("pack a.obj -o a.hgrid {options}")).unwrap();
        let json: serde_json::Value =
            serde_json::from_str(&folder.says("info a.hgrid --json").unwrap()).unwrap();
        assert_eq!((&json["triangles"], &json["has_mesh"]), (&3.into(), &true.into()));
        assert_eq!(json["quality"], quality);
        let total = fs::metadata(folder.0.join("a.hgrid")).unwrap().len();
        assert_eq!(json["total_bytes"], total);
        let facts = folder.says("info a.hgrid").unwrap();
        assert!(facts.contains("box (padded)") && facts.contains("longest list"), "{facts}");
        assert!(folder.says("validate a.hgrid").unwrap().contains("valid"));
        assert!(folder.says("a.hgrid --size 16").unwrap().contains("3 triangles"));
    }

    let blob = fs::read(folder.0.join("a.hgrid")).unwrap();
    fs::write(folder.0.join("cut.hgrid"), &blob[..blob.len() - 64]).unwrap();
    assert!(folder.fails("validate cut.hgrid").unwrap().contains("it is cut off"));
    fs::write(folder.0.join("stub.hgrid"), &blob[..60]).unwrap();
    fs::write(folder.0.join("text"), "what is it?\n").unwrap();
    for (words, expected) in [
        (
            "info stub.hgrid",
            "`stub.hgrid`: it is cut off: it has 60 bytes, but its header takes 128",
        ),
        (
            "validate stub.hgrid",
            "`stub.hgrid`: it is cut off: it has 60 bytes, but its header takes",
        ),
        ("info text", "cannot read `text`: it has another format: a mesh is read from .ply"),
        ("validate text", "`text` is not a blob: `hgrid pack` makes one of a mesh"),
        ("validate none", "cannot read `none`: cannot open it"),
    ] {
        let said = folder.fails(words).unwrap();
        assert!(said.contains(expected), "{said}");
    }
    fs::write(folder.0.join("long.hgrid"), [&blob[..], &[0; 3]].concat()).unwrap();
    let said = folder.says("validate long.hgrid").unwrap();
    assert!(
        said.contains("valid") && said.contains("3 bytes behind it are no part of it"),
        "{said}"
    );
    // Flip a bit in the boxes or the ids of the tree.
    let mut damaged = blob;
    damaged[128 + 20] ^= 0x40;
    fs::write(folder.0.join("damaged.hgrid"), damaged).unwrap();
    assert!(folder.fails("validate damaged.hgrid").unwrap().contains("damaged"));
    let said = folder.fails("validate a.obj").unwrap();
    let expected = "`a.obj` is an OBJ file, not a blob: `hgrid pack` makes one";
    assert!(said.contains(expected), "{said}");
    fs::write(folder.0.join("points.obj"), "v 0 0 0\n").unwrap();
    let said = folder.says("pack points.obj -o points.hgrid").unwrap();
    assert!(said.contains("`points.obj` has no triangles: every ray misses"), "{said}");
    assert!(folder.fails("validate a.hgrid --mesh a.obj").unwrap().contains("leave out --mesh"));
    assert!(folder.fails("info nothing.hgrid").unwrap().contains("cannot open it"));
}

/// A mesh without height, on a field of instances: seen from above, not along its plane.
#[test]
fn flat_meshes_are_seen_on_a_field() {
    let folder = Folder::new("flat").unwrap();
    fs::write(folder.0.join("flat.obj"), "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 3 2\nf 1 2 2\n").unwrap();
    for count in [1, 4] {
        let words = format!("animate flat.obj --size 32 --frames 1 --instances {count}");
        let said = folder.says(&words).unwrap();
        assert!(said.contains("The scene of its instances has"), "{said}");
    }
}

#[test]
fn flat_triangles_are_counted_alike_in_a_mesh_and_in_its_blob() {
    let folder = Folder::new("counted").unwrap();
    fs::write(folder.0.join("flat.obj"), "v 0 0 0\nv 1 0 0\nv 0 0 1\nv 2 0 0\nf 1 3 2\nf 1 2 4\n")
        .unwrap();
    folder.says("pack flat.obj -o flat.hgrid").unwrap();
    for file in ["flat.obj", "flat.hgrid"] {
        let said = folder.says(&format!("info {file}")).unwrap();
        assert!(said.contains("without area  1 triangle"), "{said}");
    }
}

#[test]
fn all_scenes_are_looked_for_before_the_first_is_measured() {
    let folder = Folder::new("looked").unwrap();
    for command in ["table", "figures -o charts"] {
        for (scene, expected) in [
            ("typo.ply", "error: cannot load `typo.ply`: cannot open it"),
            ("procedural:typo", "error: no scene `procedural:typo`: NAME in procedural:NAME is"),
        ] {
            let said = folder.fails(&format!("{command} procedural:knot:2K {scene}")).unwrap();
            assert!(said.contains(expected), "{said}");
            assert!(!folder.0.join("charts").exists());
        }
    }
    // Words of a file do not move the cursor.
    fs::write(folder.0.join("odd.obj"), "v 0 \u{1b}[2J 0\n").unwrap();
    let said = folder.fails("info odd.obj").unwrap();
    assert!(said.contains("line 1: `\\u{1b}[2J` is no number"), "{said}");
}

#[test]
fn one_triangle_is_no_plural() {
    let folder = Folder::new("one").unwrap();
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    fs::write(folder.0.join("one.obj"), format!("{corners}f 1 2 3\n")).unwrap();
    fs::write(folder.0.join("flat.obj"), format!("{corners}f 1 2 3\nf 1 1 1\n")).unwrap();
    fs::write(folder.0.join("nan.obj"), format!("{corners}v nan 0 0\nf 1 2 3\nf 1 2 4\n")).unwrap();
    for (words, expected) in [
        ("render one.obj --size 16", "one.obj: 1 triangle, 3 vertices, "),
        ("render one.obj --size 16 --method fixed --ao 0 --no-shadows", "; 256 rays in "),
        ("render nan.obj --size 16", "; one triangle that is not finite is left out"),
        ("info flat.obj", "without area  1 triangle\n"),
        ("pack one.obj -o one.hgrid", "its mesh of 1 triangle\n"),
        ("validate one.hgrid", "valid, a grid by bvh of 1 triangle, proved"),
        ("animate one.obj --size 16 --frames 1", "one.obj: 1 triangle, bvh"),
        ("animate a.obj --size 16 --frames 1 --instances 1", "a.obj: 3 triangles, 1 instance, bvh"),
    ] {
        let said = folder.says(words).unwrap();
        assert!(said.contains(expected), "{words}: {said}");
    }
}

/// Commands that load a mesh name the parts of it that they do not show.
#[test]
fn what_is_left_out_is_told() {
    let folder = Folder::new("left-out").unwrap();
    let mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nf 1 2 3\nf 1 2 4\n";
    fs::write(folder.0.join("nan.obj"), mesh).unwrap();
    let gltf = r#"{"asset": {"version": "2.0"}, "cameras": [{"type": "perspective",
        "perspective": {"yfov": 1, "znear": 1}}]}"#;
    fs::write(folder.0.join("eye.gltf"), gltf).unwrap();
    for (command, options) in [
        ("pack", "-o b.hgrid"),
        ("table", "--size 9 --repeat 1 --methods bvh"),
        ("figures", "--size 9 --repeat 1 --methods fixed --densities 4"),
        ("animate", "--size 9 --frames 1"),
        ("render", "--size 9"),
        ("info", ""),
    ] {
        let words = format!("{command} nan.obj+eye.gltf {options}");
        let output = folder.hgrid(&words).unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{words}: {said}");
        assert_eq!(said.matches("eye.gltf: not shown: 1 camera\n").count(), 1, "{words}: {said}");
        // `render` prints this among its numbers, and `info` has a row for it.
        let count = usize::from(!matches!(command, "render" | "info"));
        let left_out = ": one triangle that is not finite is left out\n";
        assert_eq!(said.matches(left_out).count(), count, "{words}: {said}");
    }
}

/// A command succeeds although nobody reads its notices.
#[test]
fn notices_that_nobody_reads_end_no_command() {
    let folder = Folder::new("unread").unwrap();
    fs::write(folder.0.join("nan.obj"), "v 0 0 0\nv 1 0 0\nv nan 1 0\nv 0 1 0\nf 1 2 3\nf 1 2 4\n")
        .unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_hgrid"));
    command.current_dir(&folder.0).args(["pack", "nan.obj", "-o", "a.HGRID"]);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stderr.take());
    assert!(child.wait().unwrap().success() && folder.0.join("a.HGRID").exists());
}

#[test]
fn a_blob_can_be_an_array_of_c() {
    let folder = Folder::new("c").unwrap();
    folder.says("pack a.obj -o a.hgrid").unwrap();
    folder.says("pack a.obj -o a.c --c-array scene_1").unwrap();
    let blob = fs::read(folder.0.join("a.hgrid")).unwrap();
    let text = fs::read_to_string(folder.0.join("a.c")).unwrap();
    let (head, body) = text.split_once("= {").unwrap();
    assert!(head.contains(&format!("HGRID_ALIGNED const unsigned char scene_1[{}]", blob.len())));
    let numbers = body.trim_end_matches("};\n").split(',').map(str::trim);
    let numbers =
        numbers.filter(|number| !number.is_empty()).map(|number| number.parse::<u8>().unwrap());
    assert!(numbers.eq(blob));
    for name in ["a.h", "a.H", "a.HPP"] {
        folder.says(&format!("pack a.obj -o {name} --c-array a")).unwrap();
        let text = fs::read_to_string(folder.0.join(name)).unwrap();
        assert!(text.contains("HGRID_ALIGNED static const"), "{name}");
    }

    for (words, expected) in [
        ("pack a.obj -o a.c", "add --c-array NAME"),
        ("pack a.obj -o b.hgrid --c-array b", "is not C by its name"),
        ("pack a.obj -o b.c --c-array 1b", "is no name in C"),
        (
            "pack a.obj -o b.c --c-array int",
            "`int` is a name of C, C++ or hgrid.h, or may become one: take",
        ),
        ("pack a.obj -o b.c --c-array _Bool", "`_Bool` is a name of C"),
        ("pack a.obj -o b.c --c-array class", "`class` is a name of C"),
        ("pack a.obj -o b.c --c-array hgrid_open", "`hgrid_open` is a name of C"),
        ("pack a.obj -o b.c --c-array HGRID_H", "`HGRID_H` is a name of C"),
        ("pack a.obj -o b.c --c-array size_t", "`size_t` is a name of C"),
        ("pack a.obj -o b.c --c-array NULL", "`NULL` is a name of C"),
        ("pack a.obj -o b.c --c-array SIZE_MAX", "`SIZE_MAX` is a name of C"),
        ("pack a.obj -o b.c --c-array __linux__", "`__linux__` is a name of C"),
        ("pack a.obj -o b.ply", "`b.ply` would be no blob by its name: name a file like x.hgrid"),
        ("pack a.obj -o b.PNG", "`b.PNG` would be no blob by its name"),
        ("pack a.obj -o keep.txt", "`keep.txt` would be no blob by its name"),
        ("pack a.obj -o -", "it cannot be standard output: name a file"),
        ("pack a.obj -o b.hgrid --depth 2", "--depth is for --method recursive"),
    ] {
        let message = folder.refuses(words).unwrap();
        assert!(message.contains(expected), "{message}");
    }
}

/// Beyond some density, a build takes fewer cells than it was asked for. The command refuses such a density.
#[test]
fn a_density_that_a_mesh_cannot_have_is_refused() {
    let folder = Folder::new("density").unwrap();
    let knot = "procedural:knot:2000 --method one-level";
    for words in ["render --size 16 -o a.png", "pack -o a.hgrid"] {
        let words = format!("{words} {knot}");
        folder.says(&format!("{words} --density 32")).unwrap();
        let said = folder.fails(&format!("{words} --density 128")).unwrap();
        let expected = "at most 16 references to each triangle; --density 32 fits";
        assert!(said.contains(expected), "{words}: {said}");
    }
    let words = "figures procedural:knot:2000 --size 16 --repeat 1 --methods one-level --densities";
    let output = folder.hgrid(&format!("{words} 4,64,128,32")).unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.contains("triangle: one-level 64, 128"), "{said}");
    let picture = fs::read_to_string(folder.0.join("figures/figure1.svg")).unwrap();
    assert!(picture.contains("\n32\n") && !picture.contains("\n128\n"), "{picture}");
}

#[test]
fn wrong_words_have_a_status_of_their_own_and_change_nothing() {
    let folder = Folder::new("usage").unwrap();
    for (words, expected) in [
        ("a.obj -o -", "it cannot be standard output: name a file"),
        ("a.obj -o a.jpg", "pictures are PNG, so name it a.png"),
        ("a.obj --density x --method fixed", "a density is a finite number above 0, like 4 or 0.5"),
        ("a.obj --density 4", "--density is not for bvh"),
        ("a.obj -o /dev/stdout", "it cannot be standard output: name a file"),
        (
            "a.obj --view front --target 0,0,0",
            "'--view <VIEW>' cannot be used with '--target <X,Y,Z>'",
        ),
        ("figures a.obj --methods bvh", "figure 1 shows densities, which bvh has none of"),
        ("figures a.obj --densities 0", "a density is a finite number above 0"),
        ("animate a.obj --method fixed --refit -o b", "--refit is for --method bvh"),
        ("compare a.obj --methods fixed --spheres -o b", "cannot be used with"),
        ("compare a.obj --methods fixed --spheres", "--spheres compares bvh with Embree: add bvh"),
    ] {
        let message = folder.refuses(words).unwrap();
        assert!(message.contains(expected), "{words}: {message}");
    }
    assert!(folder.fails("figures nothing.ply -o new").unwrap().contains("cannot open it"));
    assert!(!folder.0.join("new").exists());
    // The command learns that a file does not exist when it opens it, and then ends with status 1.
    assert_eq!(folder.hgrid("render nothing.ply").unwrap().status.code(), Some(1));
}

#[test]
fn meshes_that_stand_more_than_once_are_instances() {
    let folder = Folder::new("gltf").unwrap();
    let corners = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let bytes: Vec<_> = corners.as_flattened().iter().flat_map(|c| c.to_le_bytes()).collect();
    fs::write(folder.0.join("a.bin"), bytes).unwrap();
    let scene = |second: &str| {
        format!(
            r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0, 1]}}],
            "nodes": [{{"mesh": 0}}, {{"mesh": 0, {second}}}],
            "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
            "buffers": [{{"byteLength": 36, "uri": "a.bin"}}],
            "bufferViews": [{{"buffer": 0, "byteLength": 36}}],
            "accessors": [{{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3,
                "min": [0, 0, 0], "max": [1, 1, 0]}}]}}"#
        )
    };
    let is = |file: &str, words: &str| {
        let json = folder.says(&format!("render {file} --size 32 --json {words}")).unwrap();
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        let number = |name: &str| json[name].as_u64().unwrap();
        (number("triangles"), number("instances"), number("hits"))
    };
    fs::write(folder.0.join("two.gltf"), scene(r#""translation": [1, 0.5, 0]"#)).unwrap();
    let (triangles, instances, hits) = is("two.gltf", "--view front");
    assert!((triangles, instances) == (2, 2) && hits > 100, "{hits}");
    // A grid takes no instances, and sees the same.
    let as_mesh = is("two.gltf", "--view front --method fixed --samples 4");
    assert_eq!(as_mesh, (2, 0, hits));
    assert_eq!(is("two.gltf", "--view front --shading heat").1, 0);
    let text = folder.says("two.gltf --size 16").unwrap();
    assert!(text.contains("2 triangles, 6 vertices in 2 instances"), "{text}");
    // A flattened instance has no inverse, and becomes triangles.
    fs::write(folder.0.join("flat.gltf"), scene(r#""scale": [1, 1, 0]"#)).unwrap();
    assert_eq!(is("flat.gltf", "--view front").1, 0);
}
