/* Loans of loans.h, with the names used there. A camera fills buffers and lends them: capture counts the first user and
 * hands the buffer to the tracker, which may share it with the log. What hands buffers over (rings in the program) is
 * one place per reader that releases and acquires; a full one refuses, and the giver gives its use back. The last user
 * returns the buffer to the camera, through a release and an acquire. Camera and capture are one thread here. Runs are
 * endless. Memory: see weak_memory.pml.
 *
 * Checked: a buffer that is returned has no user; no access to a buffer is a race; the count of users never falls below
 * zero; buffers come back (the camera can always fill one again). */
#ifndef SLOTS
#define SLOTS 2
#endif
#define THREADS 3
#define MESSAGES (2 * SLOTS + 2) /* in each users_, in each way back to the camera, in each place of handing over */
#include "weak_memory.pml"

#ifndef kSwap
#define kSwap ACQ_REL
#endif
#ifndef SHARE_FIRST /* 0: hands a buffer on before it is shared, which share() forbids */
#define SHARE_FIRST 1
#endif

#define kCapture 0
#define kTracker 1
#define kLog 2
#define message_of_return(slot) (SLOTS + (slot))
#define message_to(reader) (2 * SLOTS + (reader) - 1)
#define kNone 255
#define held_by(thread) (1 << (thread))
#define handed_to(reader) (1 << (2 + (reader)))
#define by_others(slot) (access_of(kTracker, slot) | access_of(kLog, slot))

byte users[SLOTS];
byte holders[SLOTS];    /* who really has it: threads and places of handing over */
bit lent[SLOTS];
byte handed[3] = kNone; /* to the tracker and the log */

#define done_with(me, slot) holders[slot] = holders[slot] & ~held_by(me)

inline one_less(me, slot) {
  atomic {
    assert(users[slot] > 0);
    modifying(me, slot, kSwap);
    users[slot]--;
    last = (users[slot] == 0)
  }
}

inline give_back(me, slot) {
  one_less(me, slot);
  if
  :: atomic {
       last ->
       assert(holders[slot] == 0 && lent[slot]);
       storing(me, message_of_return(slot), RELEASE);
       lent[slot] = 0;
       last = 0
     }
  :: !last
  fi
}

inline share(me, slot) {
  atomic {
    assert(users[slot] > 0);
    modifying(me, slot, RELAXED);
    users[slot]++
  }
}

inline hand_over(me, reader, slot) {
  if
  :: atomic {
       handed[reader] == kNone ->
       storing(me, message_to(reader), RELEASE);
       handed[reader] = slot;
       holders[slot] = holders[slot] | handed_to(reader)
     }
  :: handed[reader] != kNone -> refused = 1
  fi
}

inline take(me, slot) {
  atomic {
    handed[me] != kNone ->
    slot = handed[me];
    handed[me] = kNone;
    holders[slot] = (holders[slot] & ~handed_to(me)) | held_by(me);
    loading(me, message_to(me), ACQUIRE)
  }
}

active proctype capture() {
  byte slot = 0;
  bit last, refused;
  do
  :: atomic {
       if
       :: !lent[slot] -> loading(kCapture, message_of_return(slot), ACQUIRE)
       :: else -> goto next_slot
       fi
     };
has_buffer:
     atomic { access(kCapture, slot, by_others(slot)) };
     /* lend() */
     atomic {
       storing(kCapture, slot, RELAXED);
       users[slot] = 1;
       lent[slot] = 1
     };
     hand_over(kCapture, kTracker, slot);
     if
     :: refused -> refused = 0; give_back(kCapture, slot)
     :: !refused
     fi;
next_slot:
     slot = (slot + 1) % SLOTS
  od
}

active proctype tracker() {
  byte slot;
  bit last, refused;
  do
  :: take(kTracker, slot);
     atomic { access(kTracker, slot, access_of(kCapture, slot)) };
     if
     :: true ->
#if SHARE_FIRST
        share(kTracker, slot);
        hand_over(kTracker, kLog, slot);
#else
        hand_over(kTracker, kLog, slot);
        share(kTracker, slot);
#endif
        if
        :: refused -> one_less(kTracker, slot); atomic { assert(!last); refused = 0 } /* it still uses it itself */
        :: !refused
        fi
     :: true
     fi;
     /* the last look, when the next image has come */
     atomic { access(kTracker, slot, access_of(kCapture, slot)); done_with(kTracker, slot) };
     give_back(kTracker, slot);
     slot = 0
  od
}

active proctype log() {
  byte slot;
  bit last;
  do
  :: take(kLog, slot);
     atomic { access(kLog, slot, access_of(kCapture, slot)); done_with(kLog, slot) };
     give_back(kLog, slot);
     slot = 0
  od
}

ltl come_back { [] <> (capture@has_buffer) }
