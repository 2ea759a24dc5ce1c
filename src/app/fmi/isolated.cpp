#include "isolated.hpp"

#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <exception>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "../files.hpp"
#include "../input.hpp"

namespace ricochet::app {

namespace {

/// Kinds of messages from the process of the FMU.
enum class Kind : std::uint8_t { names, event, row, end, finding, refusal };

/// Values as bytes, in the order in which they are written.
class Bytes {
public:
    Bytes() = default;
    explicit Bytes(std::string text) : text_(std::move(text)) {}

    template <class T>
    requires std::is_trivially_copyable_v<T>
    void put(const T& value) { text_.append(reinterpret_cast<const char*>(&value), sizeof value); }
    void put(const std::string& value)
    {
        put(value.size());
        text_ += value;
    }
    template <class T>
    void put(const std::vector<T>& values)
    {
        put(values.size());
        for (const T& value : values) put(value);
    }

    template <class T>
    requires std::is_trivially_copyable_v<T>
    void get(T& value)
    {
        take(sizeof value);
        std::memcpy(&value, text_.data() + at_ - sizeof value, sizeof value);
    }
    void get(std::string& value)
    {
        std::size_t size = 0;
        get(size);
        take(size);
        value = text_.substr(at_ - size, size);
    }
    template <class T>
    void get(std::vector<T>& values)
    {
        std::size_t size = 0;
        get(size);
        if (size > text_.size())
            throw std::runtime_error("a message of the FMU's process is damaged");
        values.resize(size);
        for (T& value : values) get(value);
    }

    [[nodiscard]] const std::string& text() const noexcept { return text_; }

private:
    void take(std::size_t size)
    {
        if (size > text_.size() - at_) {
            throw std::runtime_error("a message of the FMU's process is damaged");
        }
        at_ += size;
    }

    std::string text_;
    std::size_t at_ = 0;
};

// What messages hold; `pass` is `put` or `get`.

template <class E, class Pass>
void pass_event(E& event, const Pass& pass)
{
    pass(event.t);
    pass(event.causes);
    pass(event.indicator);
    pass(event.watch);
    pass(event.before);
    pass(event.after);
}

template <class R, class Pass>
void pass_row(R& row, const Pass& pass)
{
    pass(row.t);
    pass(row.place);
    pass(row.values);
}

template <class R, class Pass>
void pass_end(R& run, const Pass& pass)
{
    pass(run.end);
    pass(run.integration);
    pass(run.t);
    pass(run.x);
    pass(run.indicator);
    pass(run.message);
    pass(run.warnings);
    pass(run.method);
    pass(run.steps);
    pass(run.rejected);
    pass(run.calls);
}

class Sender {
public:
    explicit Sender(int descriptor) : descriptor_(descriptor) {}

    void send(Kind kind, const Bytes& bytes) const
    {
        Bytes head;
        head.put(kind);
        head.put(bytes.text().size());
        if (!write_all(descriptor_, head.text() + bytes.text())) _exit(1);
    }
    template <class T, class Pass>
    void send(Kind kind, const T& value, const Pass& pass_value) const
    {
        Bytes bytes;
        pass_value(value, [&](const auto& part) { bytes.put(part); });
        send(kind, bytes);
    }

private:
    int descriptor_;
};

void run_there(const fmi::Fmu& fmu, const fmi::Options& options, const Sender& sender)
{
    fmi::Simulation simulation(fmu, options);
    const fmi::Run& run = simulation.run();
    Bytes names;
    names.put(run.output);
    sender.send(Kind::names, names);
    std::size_t events = 0, rows = 0;
    const auto send_new = [&] {
        for (; events < run.events.size(); ++events) {
            sender.send(Kind::event, run.events[events],
                        [](const auto& e, const auto& pass) { pass_event(e, pass); });
        }
        for (; rows < run.rows.size(); ++rows) {
            sender.send(Kind::row, run.rows[rows],
                        [](const auto& r, const auto& pass) { pass_row(r, pass); });
        }
    };
    send_new();
    while (simulation.advance()) send_new();
    send_new();
    sender.send(Kind::end, simulation.finish(),
                [](const auto& r, const auto& pass) { pass_end(r, pass); });
}

/// The process of the FMU, which calls `work(sender)`. Never returns.
template <class Work>
[[noreturn]] void live(int descriptor, const Work& work)
{
    // What the library prints is no result.
    dup2(STDERR_FILENO, STDOUT_FILENO);
    std::setvbuf(stdout, nullptr, _IOLBF, BUFSIZ);  // before a crash, too
    const Sender sender(descriptor);
    try {
        work(sender);
    } catch (const std::exception& error) {
        Bytes bytes;
        bytes.put(std::string(error.what()));
        sender.send(Kind::refusal, bytes);
    }
    std::fflush(nullptr);
    _exit(0);
}

bool read_all(int descriptor, char* to, std::size_t size)
{
    while (size > 0) {
        const ssize_t count = read(descriptor, to, size);
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) return false;
        to += count;
        size -= static_cast<std::size_t>(count);
    }
    return true;
}

/// The next message; false: the process has ended.
bool receive(int descriptor, Kind& kind, Bytes& bytes)
{
    std::string head(sizeof(Kind) + sizeof(std::size_t), '\0');
    if (!read_all(descriptor, head.data(), head.size())) return false;
    Bytes of(head);
    std::size_t size = 0;
    of.get(kind);
    of.get(size);
    std::string text(size, '\0');
    if (!read_all(descriptor, text.data(), size)) return false;
    bytes = Bytes(std::move(text));
    return true;
}

std::string how_it_ended(int status)
{
    if (WIFSIGNALED(status)) {
        return fmt::format("by signal {} ({})", WTERMSIG(status), strsignal(WTERMSIG(status)));
    }
    return fmt::format("with exit status {}", WEXITSTATUS(status));
}

/// Calls `work(sender)` in a process of its own and `take(kind, bytes)` here for every message.
/// @return how the process ended if it has not sent an end, else nothing
template <class Work, class Take>
std::optional<std::string> run_apart(const Work& work, const Take& take)
{
    int ends[2];
    if (pipe(ends) != 0) throw std::runtime_error("no pipe can be made");
    std::fflush(nullptr);
    const pid_t child = fork();
    if (child < 0) throw std::runtime_error("no process can be started");
    if (child == 0) {
        close(ends[0]);
        live(ends[1], work);
    }
    close(ends[1]);
    bool ended = false;
    std::string refusal;
    Kind kind{};
    Bytes bytes;
    std::exception_ptr damage;
    try {
        while (receive(ends[0], kind, bytes)) {
            if (kind == Kind::refusal) {
                bytes.get(refusal);
            } else {
                take(kind, bytes);
            }
            ended = ended || kind == Kind::end;
        }
    } catch (...) {
        damage = std::current_exception();
    }
    close(ends[0]);
    int status = 0;
    while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    if (damage) std::rethrow_exception(damage);
    if (!refusal.empty()) throw BadInput(refusal);
    if (ended) return std::nullopt;
    return how_it_ended(status);
}

}  // namespace

fmi::Run run_isolated(const fmi::Fmu& fmu, const fmi::Options& options)
{
    fmi::Run run;
    const auto work = [&](const Sender& sender) { run_there(fmu, options, sender); };
    const auto how = run_apart(work, [&](Kind kind, Bytes& bytes) {
        const auto get = [&](auto& part) { bytes.get(part); };
        if (kind == Kind::names) bytes.get(run.output);
        if (kind == Kind::event) pass_event(run.events.emplace_back(), get);
        if (kind == Kind::row) pass_row(run.rows.emplace_back(), get);
        if (kind == Kind::end) pass_end(run, get);
    });
    if (!how) return run;
    run.end = fmi::End::call_failed;
    run.message =
        fmt::format("{}: its library has ended the process {}", fmu.description().file, *how);
    if (!run.events.empty()) {
        run.t = run.events.back().t;
        run.x = run.events.back().after;
    }
    return run;
}

std::vector<fmi::Finding> check_isolated(const fmi::Fmu& fmu)
{
    std::vector<fmi::Finding> findings;
    const auto work = [&](const Sender& sender) {
        for (const fmi::Finding& finding : fmi::check(fmu)) {
            Bytes bytes;
            bytes.put(finding.fault);
            bytes.put(finding.text);
            sender.send(Kind::finding, bytes);
        }
        sender.send(Kind::end, Bytes());
    };
    const auto how = run_apart(work, [&](Kind kind, Bytes& bytes) {
        if (kind != Kind::finding) return;
        fmi::Finding& finding = findings.emplace_back();
        bytes.get(finding.fault);
        bytes.get(finding.text);
    });
    if (how) findings.push_back({true, fmt::format("the library has ended the process {}", *how)});
    return findings;
}

}  // namespace ricochet::app
