// FMUs of the models in probe.c, of both versions, in a folder of their own.
#pragma once

#include <unistd.h>

#include <filesystem>
#include <string>
#include <string_view>

#include "ricochet/fmi/fmu.hpp"
#include "zip_writer.hpp"

namespace ricochet::fmi_test {

/// A folder for one test, removed with what is in it.
class Folder {
public:
    Folder()
    {
        std::string name = (std::filesystem::temp_directory_path() / "fmi-test-XXXXXX").string();
        if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no folder");
        path_ = name;
    }
    ~Folder() { std::filesystem::remove_all(path_); }
    Folder(const Folder&) = delete;
    Folder& operator=(const Folder&) = delete;

    [[nodiscard]] std::filesystem::path operator/(const std::string& name) const
    {
        return path_ / name;
    }

private:
    std::filesystem::path path_;
};

struct ProbeModel {
    std::string name;
    int states, indicators;
    bool completed_steps = false, derivatives = false;
};

/// The description of a model, in the words of a version.
[[nodiscard]] inline std::string description_of(const ProbeModel& m, int version)
{
    const bool two = version == 2;
    std::string text =
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiModelDescription fmiVersion=\"" +
        std::string(two ? "2.0" : "3.0") + "\" modelName=\"" + m.name + "\" " +
        (two ? "guid" : "instantiationToken") + "=\"" + m.name + "\"" +
        (two ? " numberOfEventIndicators=\"" + std::to_string(m.indicators) + "\"" : "") +
        ">\n<ModelExchange modelIdentifier=\"probe\"";
    if (two && !m.completed_steps) text += " completedIntegratorStepNotNeeded=\"true\"";
    if (!two && m.completed_steps) text += " needsCompletedIntegratorStep=\"true\"";
    if (m.derivatives) {
        text += two ? " providesDirectionalDerivative=\"true\""
                    : " providesDirectionalDerivatives=\"true\"";
    }
    text += "/>\n<DefaultExperiment startTime=\"0\" stopTime=\"3\"/>\n<ModelVariables>\n";
    int count = 0;
    const auto variable = [&](const std::string& name, int reference, const std::string& causality,
                              const std::string& variability, const std::string& inside,
                              std::string type = "Real") {
        ++count;
        const std::string shared = " name=\"" + name + "\" valueReference=\"" +
                                   std::to_string(reference) + "\" causality=\"" + causality +
                                   "\" variability=\"" + variability + "\"";
        if (two) {
            text += "<ScalarVariable" + shared + "><" + type + inside + "/></ScalarVariable>\n";
        } else {
            type = type == "Real" ? "Float64" : "Int32";
            text += "<" + type + shared + inside + "/>\n";
        }
    };
    std::string derivatives;
    if (two) {
        for (int i = 0; i < m.states; ++i) {
            variable("x[" + std::to_string(i + 1) + "]", i, "output", "continuous",
                     " start=\"0\" reinit=\"true\"");
        }
        for (int i = 0; i < m.states; ++i) {
            variable("der(x[" + std::to_string(i + 1) + "])", 100 + i, "local", "continuous",
                     " derivative=\"" + std::to_string(i + 1) + "\"");
            derivatives += "<Unknown index=\"" + std::to_string(count) + "\"/>";
        }
    } else if (m.states > 0) {
        const std::string dimension =
            "<Dimension start=\"" + std::to_string(m.states) + "\"/></Float64>\n";
        text += "<Float64 name=\"x\" valueReference=\"0\" causality=\"output\" start=\"0\">" +
                dimension;
        text += "<Float64 name=\"der(x)\" valueReference=\"100\" derivative=\"0\">" + dimension;
        derivatives = "<ContinuousStateDerivative valueReference=\"100\"/>";
    }
    for (int i = 0; i < 3; ++i)
        variable("p" + std::to_string(i), 10 + i, "parameter", "tunable", " start=\"0\"");
    for (int i = 0; i < 8; ++i)
        variable("count" + std::to_string(i), 20 + i, "local", "discrete", "");
    variable("violations", 30, "local", "discrete", "");
    variable("q", 31, m.states == 0 ? "output" : "local", "discrete", "", "Integer");
    variable("u", 40, "input", "continuous", " start=\"0\"");
    variable("d", 41, "input", "discrete", " start=\"0\"");
    if (!two) {
        for (int i = 0; i < m.indicators; ++i)
            variable("z" + std::to_string(i + 1), 50 + i, "local", "continuous", "");
        for (int i = 0; i < m.indicators; ++i) {
            derivatives += "<EventIndicator valueReference=\"" + std::to_string(50 + i) + "\"/>";
        }
    }
    text += "</ModelVariables>\n<ModelStructure>";
    text += two ? "<Derivatives>" + derivatives + "</Derivatives>" : derivatives;
    return text + "</ModelStructure>\n</fmiModelDescription>\n";
}

/// The archive of a description with the library of probes.
[[nodiscard]] inline std::string probe_archive(const std::string& description, int version,
                                               std::vector<Entry> more = {})
{
    std::vector<Entry> entries = {
        {.name = "modelDescription.xml", .bytes = description},
        {.name = version == 2 ? "binaries/linux64/probe.so" : "binaries/x86_64-linux/probe.so",
         .bytes = bytes_of(RICOCHET_PROBE)}};
    entries.insert(entries.end(), more.begin(), more.end());
    return archive_of(entries);
}

[[nodiscard]] inline fmi::Fmu probe(const ProbeModel& model, int version)
{
    const Folder folder;
    const std::filesystem::path file = folder / (model.name + ".fmu");
    write(file, probe_archive(description_of(model, version), version));
    return fmi::Fmu(file);
}

}  // namespace ricochet::fmi_test
