#include "keep_model.hpp"

#include <fmt/format.h>

#include <optional>
#include <string>
#include <string_view>
#include <system_error>

#include "files.hpp"
#include "input.hpp"
#include "ricochet/nn/model.hpp"
#include "say.hpp"

namespace ricochet::app {

namespace {

namespace fs = std::filesystem;

/// A name that is not in use: "ball.kept.safetensors", "ball.kept-2.safetensors", ...
std::optional<fs::path> free_name(const fs::path& directory, const fs::path& file)
{
    constexpr int most = 100;
    for (int i = 1; i <= most; ++i) {
        fs::path name = directory / file.stem();
        name += i == 1 ? std::string(".kept") : fmt::format(".kept-{}", i);
        name += file.extension();
        std::error_code error;
        if (!fs::exists(name, error) && !error) return name;
    }
    return std::nullopt;
}

}  // namespace

void keep_model(const Model& model, const fs::path& file, const fs::path& checkpoint)
{
    const auto why_not = [&model](const fs::path& where) -> std::string {
        try {
            save_model(model, where);
            return {};
        } catch (const ModelError& error) {
            return error.what();
        }
    };
    const std::string why = why_not(file);
    if (why.empty()) return;
    std::error_code error;
    const fs::path beside = file.has_parent_path() ? file.parent_path() : fs::path(".");
    for (const fs::path& directory : {beside, fs::temp_directory_path(error)}) {
        const std::optional<fs::path> name = free_name(directory, file.filename());
        if (name && why_not(*name).empty()) {
            throw WriteError(fmt::format("{}; the model is in '{}'", why, name->string()));
        }
    }
    throw WriteError(
        fs::exists(checkpoint, error)
            ? fmt::format("{}; the training is kept in '{}', from which the same command with "
                          "--resume writes the model",
                          why, checkpoint.string())
            : fmt::format("{}, and there is no room for the model elsewhere", why));
}

void claim_training(const fs::path& out, fs::path& checkpoint, bool resume)
{
    if (checkpoint.empty()) {
        checkpoint = out;
        checkpoint += ".checkpoint";
    }
    Claims claims;
    claims.replaces("--out", out);
    claims.keeps("--checkpoint", checkpoint, resume);
}

void say_what_is_kept(const fs::path& checkpoint, const std::string& trouble)
{
    std::error_code error;
    if (!trouble.empty()) say("ricochet: {}\n", printable(trouble));
    if (fs::exists(checkpoint, error)) {
        say("ricochet: interrupted; the same command with --resume continues from '{}'\n",
            checkpoint.string());
    } else {
        say("ricochet: interrupted; nothing is kept\n");
    }
}

}  // namespace ricochet::app
