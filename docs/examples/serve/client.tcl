# Ask `stiffarm serve` from Tcl, as a postprocessor written in Tcl does at every toolpath point.
#
#   tclsh client.tcl stiffarm serve kr60-3 --cell cell.toml
#
# Needs Tcl 8.6 and nothing else. In a postprocessor: source this file, call ::stiffarm::start once when the program
# begins, ::stiffarm::ask at each point, ::stiffarm::stop at its end.

namespace eval ::stiffarm {
    variable pipe ""
    variable number 0
}

# Start the service: the command and its arguments.
proc ::stiffarm::start {args} {
    variable pipe
    set pipe [open |[concat $args [list 2>@stderr]] r+]
    fconfigure $pipe -encoding utf-8 -translation lf -buffering line
    set hello [ask hello]
    if {[dict get $hello protocol] != 1} {
        error "stiffarm speaks protocol [dict get $hello protocol], this client 1"
    }
    return $hello
}

# One question: a command, and keys with values that are JSON text, as in: ask ik point_mm {[0, 0, 0]}
proc ::stiffarm::ask {do args} {
    variable pipe
    variable number
    incr number
    set request "{\"id\": $number, \"do\": \"$do\""
    foreach {key value} $args {
        append request ", \"$key\": $value"
    }
    puts $pipe "$request}"
    if {[gets $pipe line] < 0} {
        error "stiffarm has ended"
    }
    set answer [read_json $line]
    if {[dict get $answer id] != $number} {
        error "stiffarm answered another question"
    }
    if {![dict get $answer ok]} {
        set fault [dict get $answer error]
        error "stiffarm: [dict get $fault what]: [dict get $fault value]; allowed: [dict get $fault allowed]"
    }
    return $answer
}

proc ::stiffarm::stop {} {
    variable pipe
    ask quit
    close $pipe
}

# Numbers as a JSON list.
proc ::stiffarm::vector {args} {
    return "\[[join $args {, }]\]"
}

# JSON text to Tcl: objects become dicts, lists become lists, null is empty, true and false are 1 and 0.
proc ::stiffarm::read_json {text} {
    set tokens [regexp -all -inline {[][{}:,]|"(?:[^"\\]|\\.)*"|[^][{}:,"\s]+} $text]
    set at 0
    return [value $tokens at]
}

proc ::stiffarm::value {tokens at_name} {
    upvar 1 $at_name at
    set token [lindex $tokens $at]
    incr at
    switch -- $token {
        "\{" {
            set found [dict create]
            while {[lindex $tokens $at] ne "\}"} {
                if {[lindex $tokens $at] eq ","} { incr at }
                set key [word [lindex $tokens $at]]
                incr at 2
                dict set found $key [value $tokens at]
            }
            incr at
            return $found
        }
        "\[" {
            set found [list]
            while {[lindex $tokens $at] ne "\]"} {
                if {[lindex $tokens $at] eq ","} { incr at }
                lappend found [value $tokens at]
            }
            incr at
            return $found
        }
        null { return "" }
        true { return 1 }
        false { return 0 }
    }
    return [word $token]
}

# A token without its quotation marks; answers are ASCII, with \uXXXX for the rest.
proc ::stiffarm::word {token} {
    if {[string index $token 0] ne "\""} {
        return $token
    }
    set inner [string range $token 1 end-1]
    set plain ""
    while {[regexp -indices {\\(u[0-9a-fA-F]{4}|.)} $inner where]} {
        lassign $where first last
        append plain [string range $inner 0 [expr {$first - 1}]]
        set code [string range $inner [expr {$first + 1}] $last]
        switch -glob -- $code {
            u* { append plain [format %c [scan [string range $code 1 end] %x]] }
            n { append plain "\n" }
            t { append plain "\t" }
            r { append plain "\r" }
            b { append plain "\b" }
            f { append plain "\f" }
            default { append plain $code }
        }
        set inner [string range $inner [expr {$last + 1}] end]
    }
    return $plain$inner
}

# The example: the stiffest angle at the first point, then along a line with the branch and turns kept.
proc ::stiffarm::example {command} {
    set hello [start {*}$command]
    puts "robot [dict get $hello robot], [llength [dict get $hello joints]] joints"
    set up {[0, 0, 1]}
    set best [ask best_angle point_mm [vector 0 0 0] tool_axis $up]
    set gamma [dict get $best gamma_deg]
    puts [format "gamma %.2f deg: %.1f N/mm" $gamma [dict get $best k_fs_N_per_mm]]
    set last [dict get $best q_deg]
    foreach x {0 20 40 60 80 100} {
        set there [ask ik point_mm [vector $x 0 0] tool_axis $up gamma_deg $gamma near_deg [vector {*}$last]]
        set last [dict get $there q_deg]
        set moved [ask deflection q_deg [vector {*}$last] force_N {[50, 0, -100]}]
        set words [list]
        foreach q $last { lappend words [format %.3f $q] }
        puts [format "x %g: %s  %.4f mm" $x [join $words] [dict get $moved size_mm]]
    }
    if {[catch {ask ik point_mm [vector 9000 0 0] tool_axis $up} message]} {
        puts "refused: [string range $message 0 45]"
    }
    stop
}

if {[info exists argv0] && [file normalize $argv0] eq [file normalize [info script]]} {
    ::stiffarm::example $argv
}
