// Archives, descriptions and libraries that are refused, and the sentences.
#include <gtest/gtest.h>
#include <zlib.h>

#include <functional>

#include "probes.hpp"
#include "ricochet/fmi/run.hpp"

namespace ricochet::fmi::refusals_test {

namespace {

using namespace fmi_test;

const ProbeModel ball{"Ball", 2, 1};

/// The sentence with which an archive is refused.
std::string refusal(const std::string& bytes)
{
    const Folder folder;
    write(folder / "m.fmu", bytes);
    try {
        (void)Fmu(folder / "m.fmu");
    } catch (const Error& error) {
        return error.what();
    }
    return "not refused";
}

/// Of an archive with a further entry.
std::string refusal_of(const Entry& entry)
{
    return refusal(probe_archive(description_of(ball, 2), 2, {entry}));
}

void expect_contains(const std::string& text, const std::string& part)
{
    EXPECT_NE(text.find(part), std::string::npos) << text;
}

TEST(FmuArchive, EntriesThatLeadOutOfTheFolderAreRefused)
{
    const std::string names[] = {"../evil",
                                 "resources/../../evil",
                                 "/etc/evil",
                                 "C:/evil",
                                 "resources\\evil",
                                 "resources/./x",
                                 std::string("resources/a\0b", 13),
                                 std::string(2000, 'a')};
    for (const std::string& name : names) {
        expect_contains(refusal_of({.name = name, .bytes = "x"}), "the name of the entry");
    }
}

TEST(FmuArchive, LinksAndEncryptedEntriesAreRefused)
{
    expect_contains(refusal_of({.name = "resources/l", .bytes = "/etc/passwd", .mode = 0120777}),
                    "is a link or a device");
    expect_contains(refusal_of({.name = "resources/p", .bytes = "", .mode = 0010644}),
                    "is a link or a device");
    expect_contains(refusal_of({.name = "resources/e", .bytes = "x", .flags = 1}), "encrypted");
    expect_contains(refusal_of({.name = "modelDescription.xml", .bytes = "x"}), "twice");
}

std::string deflated(const std::string& bytes)
{
    z_stream stream{};
    deflateInit2(&stream, 9, Z_DEFLATED, -15, 9, Z_DEFAULT_STRATEGY);
    std::string out(bytes.size() + 100, '\0');
    std::string in = bytes;
    stream.next_in = reinterpret_cast<Bytef*>(in.data());
    stream.avail_in = static_cast<uInt>(in.size());
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = static_cast<uInt>(out.size());
    deflate(&stream, Z_FINISH);
    out.resize(stream.total_out);
    deflateEnd(&stream);
    return out;
}

TEST(FmuArchive, BombsAreRefusedWhateverSizeTheyClaim)
{
    const std::string zeros(8 << 20, '\0');
    const std::string packed = deflated(zeros);
    const auto entry = [&](std::int64_t size) {
        return Entry{.name = "resources/bomb",
                     .bytes = packed,
                     .method = 8,
                     .size = size,
                     .checksum = crc32(zeros)};
    };
    expect_contains(refusal_of(entry(8 << 20)), "too much for a model");
    expect_contains(refusal_of(entry(1000)), "is damaged");
    expect_contains(refusal_of(entry(4'000'000'000)), "too much for a model");
}

TEST(FmuArchive, DamageIsNamed)
{
    const std::string whole = probe_archive(description_of(ball, 2), 2);
    expect_contains(refusal("no zip"), "no zip archive");
    expect_contains(refusal(whole.substr(0, whole.size() - 30)), "no zip archive");
    expect_contains(refusal(archive_of({{.name = "a", .bytes = "b"}})), "modelDescription.xml");
    expect_contains(refusal_of({.name = "resources/x", .bytes = "abc", .checksum = 1}), "damaged");
    EXPECT_THROW((void)Fmu("/nowhere/m.fmu"), Error);
    EXPECT_THROW((void)Fmu("/"), Error);
}

std::string changed(std::string text, const std::string& from, const std::string& to)
{
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return text.replace(at, from.size(), to);
}

TEST(FmuDescription, WhatIsWrongIsNamedWithItsLine)
{
    struct Case {
        const char *from, *to, *expected;
    };
    const Case cases[] = {
        {"fmiVersion=\"2.0\"", "fmiVersion=\"1.0\"", "xml:2: <fmiModelDescription> has fmiVersion"},
        {" modelName=\"Ball\"", "", "xml:2: <fmiModelDescription> has no attribute modelName"},
        {"guid=\"Ball\"", "", "has no attribute guid"},
        {"modelIdentifier=\"probe\"", "",
         "xml:3: <ModelExchange> has no attribute modelIdentifier"},
        {"modelIdentifier=\"probe\"", "modelIdentifier=\"../probe\"",
         "modelIdentifier = '../probe'"},
        {"stopTime=\"3\"", "stopTime=\"three\"",
         "xml:4: <DefaultExperiment> has stopTime = 'three'"},
        {"valueReference=\"100\"", "valueReference=\"-1\"", "valueReference = '-1'"},
        {"derivative=\"1\"", "derivative=\"100\"", "derivative = 100; expected 1 to"},
        {"causality=\"output\"", "causality=\"outptu\"", "causality = 'outptu'; expected one of"},
        {"<Real", "<Rael", "has no type"},
        {"name=\"x[2]\"", "name=\"x[1]\"", "the name 'x[1]' of another"},
        {"</ModelVariables>", "</ModelVariable>", "no XML"},
        {"<Unknown index=\"3\"/>", "<Unknown index=\"0\"/>", "index = 0"},
        {"numberOfEventIndicators=\"1\"", "numberOfEventIndicators=\"many\"", "'many'"},
    };
    for (const Case& c : cases) {
        const std::string text = changed(description_of(ball, 2), c.from, c.to);
        expect_contains(refusal(probe_archive(text, 2)), c.expected);
    }
    const Case of_arrays[] = {
        {"<Dimension start=\"2\"/>", "<Dimension start=\"100000000\"/>", "Dimension"},
        {"<Dimension start=\"2\"/>", "<Dimension valueReference=\"77\"/>", "valueReference = 77"},
        {"<Dimension start=\"2\"/>", "<Dimension start=\"9999999\"/><Dimension start=\"9999999\"/>",
         "more than"},
        {"valueReference=\"100\"", "valueReference=\"0\"", "of another variable"},
        {"derivative=\"0\"", "", "has no attribute derivative"},
    };
    for (const Case& c : of_arrays) {
        const std::string text = changed(description_of(ball, 3), c.from, c.to);
        expect_contains(refusal(probe_archive(text, 3)), c.expected);
    }
}

/// The sentence with which a run is refused.
std::string run_refused(const std::string& description, int version, const Options& options = {})
{
    const Folder folder;
    write(folder / "m.fmu", probe_archive(description, version));
    try {
        (void)run(Fmu(folder / "m.fmu"), options);
    } catch (const std::exception& error) {
        return error.what();
    }
    return "not refused";
}

TEST(FmuRun, WhatCannotBeRunIsNamed)
{
    const std::string second = description_of(ball, 2), third = description_of(ball, 3);
    expect_contains(run_refused(changed(second, "\"probe\"", "\"other\""), 2),
                    "binaries/linux64/other.so: is not there");
    expect_contains(run_refused(changed(second, "guid=\"Ball\"", "guid=\"Bell\""), 2),
                    "gives no instance");
    expect_contains(run_refused(changed(second, "ModelExchange", "CoSimulation"), 2),
                    "has no function fmi2DoStep");
    expect_contains(run_refused(changed(third, "ModelExchange", "ScheduledExecution"), 3),
                    "scheduled execution is not supported");
    expect_contains(
        run_refused(changed(third, "</ModelVariables>",
                            "<Clock name=\"c\" valueReference=\"900\"/></ModelVariables>"),
                    3),
        "the clock 'c'; clocks are not supported");
    expect_contains(
        run_refused(changed(third, "<Dimension start=\"2\"/>", "<Dimension start=\"3\"/>"), 3),
        "elements");
    expect_contains(run_refused(changed(third, "<EventIndicator valueReference=\"50\"/>", ""), 3),
                    "the library has 1 EventIndicators, the description 0");
}

TEST(FmuRun, OptionsThatDoNotFitAreNamed)
{
    const std::string text = description_of(ball, 2);
    expect_contains(run_refused(text, 2, {.output = {"nothing"}}), "no variable 'nothing'");
    expect_contains(run_refused(text, 2, {.start = {{"nothing", 1.0}}}), "no variable 'nothing'");
    expect_contains(run_refused(text, 2, {.t_end = -1}), "t_end");
    expect_contains(run_refused(text, 2, {.rtol = 0}), "rtol");
    expect_contains(run_refused(text, 2, {.sample_times = {1, 0.5}}), "sample_times");
    expect_contains(run_refused(text, 2, {.inputs = {{.name = "p0", .t = {0}, .values = {1}}}}),
                    "'p0' is no input");
    expect_contains(
        run_refused(text, 2, {.inputs = {{.name = "u", .t = {1, 0}, .values = {1, 1}}}}),
        "ascending");
    expect_contains(run_refused(text, 2, {.co_simulation = true}), "offers no co-simulation");
}

TEST(FmuDescription, NamesOfElementsAreFoundAgain)
{
    const Fmu fmu = probe(ball, 3);
    const Description& d = fmu.description();
    EXPECT_EQ(d.state_names(), (std::vector<std::string>{"x[1]", "x[2]"}));
    for (const std::string& name : d.state_names()) {
        ASSERT_TRUE(d.find(name)) << name;
        EXPECT_EQ(d.name_of(*d.find(name)), name);
    }
    for (const char* name :
         {"x[0]", "x[3]", "x[1,1]", "x[]", "p0[1]", "[1]", "x[99999999999999999999]"}) {
        EXPECT_FALSE(d.find(name)) << name;
    }
    EXPECT_TRUE(fmu.has_binary());
}

}  // namespace

}  // namespace ricochet::fmi::refusals_test
