// Ask `stiffarm serve` from C++, as a postprocessor's own library does at every toolpath point.
//
//   g++ -std=c++17 -O2 -o client client.cpp
//   ./client stiffarm serve kr60-3 --cell cell.toml
//
// Needs a POSIX system (fork, pipes) and nothing else; on Windows start the process with CreateProcess and two pipes,
// the lines are the same. Instead of the small reader of JSON below any library does.

#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

// A JSON value; what it is not is left empty.
struct Json {
    bool null = false;
    bool truth = false;
    double number = 0.0;
    std::string text;
    std::vector<Json> list;
    std::map<std::string, Json> object;

    const Json& operator[](const std::string& key) const {
        const auto found = object.find(key);
        if (found == object.end()) throw std::runtime_error("answer without " + key);
        return found->second;
    }
    std::vector<double> numbers() const {
        std::vector<double> found;
        for (const Json& one : list) found.push_back(one.number);
        return found;
    }
};

class Reader {
public:
    explicit Reader(const std::string& text) : text_(text) {}

    Json value() {
        Json found;
        const char c = next();
        if (c == '{') {
            ++at_;
            while (next() != '}') {
                const std::string key = string();
                expect(':');
                found.object[key] = value();
                if (next() == ',') ++at_;
            }
            ++at_;
        } else if (c == '[') {
            ++at_;
            while (next() != ']') {
                found.list.push_back(value());
                if (next() == ',') ++at_;
            }
            ++at_;
        } else if (c == '"') {
            found.text = string();
        } else {
            const std::size_t start = at_;
            while (at_ < text_.size() && std::string(",]} ").find(text_[at_]) == std::string::npos) ++at_;
            const std::string word = text_.substr(start, at_ - start);
            found.null = word == "null";
            found.truth = word == "true";
            if (!found.null && word != "true" && word != "false") found.number = std::stod(word);
        }
        return found;
    }

private:
    const std::string& text_;
    std::size_t at_ = 0;

    char next() {
        while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n')) ++at_;
        if (at_ >= text_.size()) throw std::runtime_error("answer cut short");
        return text_[at_];
    }
    void expect(char c) {
        if (next() != c) throw std::runtime_error("answer is no JSON");
        ++at_;
    }
    std::string string() {
        expect('"');
        std::string found;
        while (at_ < text_.size() && text_[at_] != '"') {
            if (text_[at_] == '\\' && at_ + 1 < text_.size()) {
                const char c = text_[++at_];
                if (c == 'u') at_ += 4;  // letters beyond ASCII are shown as ?
                found += c == 'u' ? '?' : c == 'n' ? '\n' : c;
            } else {
                found += text_[at_];
            }
            ++at_;
        }
        expect('"');
        return found;
    }
};

std::string json(const std::vector<double>& values) {
    std::ostringstream out;
    out.precision(15);
    out << '[';
    for (std::size_t i = 0; i < values.size(); ++i) out << (i ? ", " : "") << values[i];
    out << ']';
    return out.str();
}

class Stiffarm {
public:
    explicit Stiffarm(char** command) {
        int in[2], out[2];
        if (pipe(in) != 0 || pipe(out) != 0) throw std::runtime_error("no pipe");
        child_ = fork();
        if (child_ < 0) throw std::runtime_error("no process");
        if (child_ == 0) {
            dup2(in[0], STDIN_FILENO);
            dup2(out[1], STDOUT_FILENO);
            for (const int end : {in[0], in[1], out[0], out[1]}) close(end);
            execvp(command[0], command);
            _exit(127);
        }
        close(in[0]);
        close(out[1]);
        requests_ = fdopen(in[1], "w");
        answers_ = fdopen(out[0], "r");
        if (ask("hello", "")["protocol"].number != 1.0) throw std::runtime_error("another protocol");
    }
    Stiffarm(const Stiffarm&) = delete;
    Stiffarm& operator=(const Stiffarm&) = delete;
    ~Stiffarm() {
        std::fclose(requests_);  // the end of input ends the service
        std::fclose(answers_);
        std::free(line_);
        waitpid(child_, nullptr, 0);
    }

    // One question: a command, and its keys as JSON text, as in ask("ik", "\"point_mm\": [0, 0, 0]").
    Json ask(const std::string& command, const std::string& keys) {
        ++number_;
        std::fprintf(requests_, "{\"id\": %ld, \"do\": \"%s\"%s%s}\n", number_, command.c_str(),
                     keys.empty() ? "" : ", ", keys.c_str());
        std::fflush(requests_);
        if (getline(&line_, &room_, answers_) < 0) throw std::runtime_error("stiffarm has ended");
        const std::string text(line_);
        const Json answer = Reader(text).value();
        if (answer["id"].number != static_cast<double>(number_)) throw std::runtime_error("another answer");
        if (!answer["ok"].truth) {
            const Json& fault = answer["error"];
            throw std::runtime_error(fault["what"].text + ": " + fault["value"].text);
        }
        return answer;
    }

private:
    pid_t child_ = -1;
    FILE* requests_ = nullptr;
    FILE* answers_ = nullptr;
    char* line_ = nullptr;
    std::size_t room_ = 0;
    long number_ = 0;
};

int main(int argc, char** argv) {
    if (argc < 2) {
        std::cerr << "usage: client stiffarm serve MODEL [options]\n";
        return 2;
    }
    try {
        std::signal(SIGPIPE, SIG_IGN);  // a service that has ended is an error of ask
        Stiffarm arm(argv + 1);
        const std::string up = "\"tool_axis\": [0, 0, 1]";
        // The stiffest angle at the first point, then along a line with the branch and turns kept.
        const Json best = arm.ask("best_angle", "\"point_mm\": [0, 0, 0], " + up);
        const double gamma = best["gamma_deg"].number;
        std::printf("gamma %.2f deg: %.1f N/mm\n", gamma, best["k_fs_N_per_mm"].number);
        std::vector<double> last = best["q_deg"].numbers();
        for (int x = 0; x <= 100; x += 20) {
            const Json there = arm.ask("ik", "\"point_mm\": " + json({double(x), 0.0, 0.0}) + ", " + up +
                                                 ", \"gamma_deg\": " + std::to_string(gamma) +
                                                 ", \"near_deg\": " + json(last));
            last = there["q_deg"].numbers();
            const Json moved = arm.ask("deflection", "\"q_deg\": " + json(last) + ", \"force_N\": [50, 0, -100]");
            std::printf("x %d:", x);
            for (const double q : last) std::printf(" %.3f", q);
            std::printf("  %.4f mm\n", moved["size_mm"].number);
        }
        try {
            arm.ask("ik", "\"point_mm\": [9000, 0, 0], " + up);
        } catch (const std::runtime_error& fault) {
            std::printf("refused: %.35s\n", fault.what());
        }
    } catch (const std::exception& fault) {
        std::cerr << fault.what() << '\n';
        return 1;
    }
    return 0;
}
